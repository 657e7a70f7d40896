/* The filter's algebra: the variance of a predicted quantity, and the update with one or two
   components.

   This is `variance` of filter/estimate.py and filter/plain_engine.py, operation for operation: the
   same bits. No sum is reordered and no product fused with a sum (-ffp-contract=off). A test
   compares the two on drawn values. */

#include "tuples.h"

#define STATES 3
#define COMPONENTS 2
#define MOST 512                  /* nuisances */

typedef struct {
    double x[STATES], P[STATES][STATES], cross[STATES][MOST];
    Py_ssize_t nuisances;
} estimate;

static PyObject *made_matrix(const double *values, Py_ssize_t rows, Py_ssize_t size,
                             Py_ssize_t stride) {
    PyObject *made = PyTuple_New(rows);
    for (Py_ssize_t n = 0; made != NULL && n < rows; n++) {
        PyObject *row = made_vector(values + n * stride, size);
        if (row == NULL) { Py_CLEAR(made); break; }
        PyTuple_SET_ITEM(made, n, row);
    }
    return made;
}

static int enough(Py_ssize_t given, Py_ssize_t wanted, PyObject *variances) {
    if (given != wanted) {
        PyErr_Format(PyExc_TypeError, "expected %zd arguments, got %zd", wanted, given);
        return 0;
    }
    if (!PyTuple_Check(variances) || PyTuple_GET_SIZE(variances) > MOST) {
        PyErr_Format(PyExc_ValueError, "expected a tuple of at most %d variances", MOST);
        return 0;
    }
    return 1;
}

/* --- the algebra --- */

PyDoc_STRVAR(
    dot_doc,
    "dot(a, b)\n--\n\nSum of products over the shorter of two tuples. See filter/estimate.py.");

static PyObject *dot_of(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    if (count != 2 || !PyTuple_Check(given[0]) || !PyTuple_Check(given[1])) {
        PyErr_SetString(PyExc_TypeError, "expected two tuples");
        return NULL;
    }
    const Py_ssize_t one = PyTuple_GET_SIZE(given[0]), other = PyTuple_GET_SIZE(given[1]);
    double total = 0.0;
    for (Py_ssize_t n = 0; n < (one < other ? one : other); n++) {
        const double a = PyFloat_AsDouble(PyTuple_GET_ITEM(given[0], n));
        const double b = PyFloat_AsDouble(PyTuple_GET_ITEM(given[1], n));
        if ((a == -1.0 || b == -1.0) && PyErr_Occurred()) return NULL;
        total += a * b;
    }
    return PyFloat_FromDouble(total);
}

PyDoc_STRVAR(variance_doc, "variance(P, cross, variances, h, g)\n--\n\nSee filter/estimate.py.");

static PyObject *variance(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    double P[STATES][STATES], cross[STATES][MOST], variances[MOST], h[STATES], g[MOST];
    if (!enough(count, 5, given[2])) return NULL;
    const Py_ssize_t size = PyTuple_GET_SIZE(given[2]);
    const Py_ssize_t felt = PyTuple_Check(given[4]) && PyTuple_GET_SIZE(given[4]) == 0 ? 0 : size;
    if (!read_matrix(given[0], STATES, STATES, STATES, &P[0][0]) ||
        !read_matrix(given[1], STATES, size, MOST, &cross[0][0]) ||
        !read_vector(given[2], size, variances) || !read_vector(given[3], STATES, h) ||
        !read_vector(given[4], felt, g))
        return NULL;

    const double own =
        P[0][0] * h[0] * h[0] + P[1][1] * h[1] * h[1] + P[2][2] * h[2] * h[2] +
        2.0 * (P[0][1] * h[0] * h[1] + P[0][2] * h[0] * h[2] + P[1][2] * h[1] * h[2]);
    const double shared = h[0] * dot(cross[0], g, felt) + h[1] * dot(cross[1], g, felt) +
                          h[2] * dot(cross[2], g, felt);
    double squares = 0.0;
    for (Py_ssize_t n = 0; n < felt; n++) squares += variances[n] * (g[n] * g[n]);
    const double all = own + 2.0 * shared + squares;
    return PyFloat_FromDouble(0.0 > all ? 0.0 : all);
}

/* Covariance of the state (3,) and of the nuisances (q,) with a quantity of gradient h (3,) and g
   (q,). */
static void covariances(const estimate *e, const double *variances, const double *h,
                        const double *g, double *state, double *nuisance) {
    const double (*P)[STATES] = e->P;
    state[0] = P[0][0] * h[0] + P[0][1] * h[1] + P[0][2] * h[2] + dot(e->cross[0], g, e->nuisances);
    state[1] = P[0][1] * h[0] + P[1][1] * h[1] + P[1][2] * h[2] + dot(e->cross[1], g, e->nuisances);
    state[2] = P[0][2] * h[0] + P[1][2] * h[1] + P[2][2] * h[2] + dot(e->cross[2], g, e->nuisances);
    for (Py_ssize_t n = 0; n < e->nuisances; n++)
        nuisance[n] = e->cross[0][n] * h[0] + e->cross[1][n] * h[1] + e->cross[2][n] * h[2] +
                      variances[n] * g[n];
}

typedef struct {
    double y[COMPONENTS], H[COMPONENTS][STATES], G[COMPONENTS][MOST], R[COMPONENTS][COMPONENTS];
} measured;

static int with_one(estimate *e, const double *variances, const measured *z, int states) {
    double m[STATES], n[MOST], gain[STATES] = {0.0}, P[STATES][STATES];
    covariances(e, variances, z->H[0], z->G[0], m, n);
    const double s = dot(z->H[0], m, STATES) + dot(z->G[0], n, e->nuisances) + z->R[0][0];
    if (s == 0.0) return 0;
    for (int i = 0; i < states; i++) gain[i] = m[i] / s;

    for (int i = 0; i < STATES; i++) {
        const double rest = gain[i] * s - m[i];
        e->x[i] = e->x[i] + gain[i] * z->y[0];
        for (Py_ssize_t j = 0; j < e->nuisances; j++)
            e->cross[i][j] = e->cross[i][j] - gain[i] * n[j];
        for (int j = 0; j < STATES; j++) P[i][j] = e->P[i][j] + rest * gain[j] - gain[i] * m[j];
    }
    memcpy(e->P, P, sizeof P);
    return 1;
}

static int with_two(estimate *e, const double *variances, const measured *z, int states) {
    double m_y[STATES], n_y[MOST], m_z[STATES], n_z[MOST], k_y[STATES] = {0.0}, k_z[STATES] = {0.0};
    double e_y[STATES], e_z[STATES], P[STATES][STATES];
    covariances(e, variances, z->H[0], z->G[0], m_y, n_y);
    covariances(e, variances, z->H[1], z->G[1], m_z, n_z);
    const Py_ssize_t size = e->nuisances;
    const double s_y = dot(z->H[0], m_y, STATES) + dot(z->G[0], n_y, size) + z->R[0][0];
    const double s_yz = dot(z->H[0], m_z, STATES) + dot(z->G[0], n_z, size) + z->R[0][1];
    const double s_z = dot(z->H[1], m_z, STATES) + dot(z->G[1], n_z, size) + z->R[1][1];
    const double determinant = s_y * s_z - s_yz * s_yz;
    if (determinant == 0.0) return 0;
    const double a = s_z / determinant, b = -s_yz / determinant, d = s_y / determinant;
    for (int i = 0; i < states; i++) {
        k_y[i] = a * m_y[i] + b * m_z[i];
        k_z[i] = b * m_y[i] + d * m_z[i];
    }

    for (int i = 0; i < STATES; i++) {
        e->x[i] = e->x[i] + k_y[i] * z->y[0] + k_z[i] * z->y[1];
        e_y[i] = k_y[i] * s_y + k_z[i] * s_yz - m_y[i];
        e_z[i] = k_y[i] * s_yz + k_z[i] * s_z - m_z[i];
        for (Py_ssize_t j = 0; j < size; j++)
            e->cross[i][j] = e->cross[i][j] - k_y[i] * n_y[j] - k_z[i] * n_z[j];
    }
    for (int i = 0; i < STATES; i++)
        for (int j = 0; j < STATES; j++)
            P[i][j] =
                e->P[i][j] - k_y[i] * m_y[j] - k_z[i] * m_z[j] + e_y[i] * k_y[j] + e_z[i] * k_z[j];
    memcpy(e->P, P, sizeof P);
    return 1;
}

PyDoc_STRVAR(update_doc,
"update(x, P, cross, variances, innovation, H, G, R, states)\n--\n\nSee filter/plain_engine.py.");

static PyObject *update(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    estimate e;
    measured z;
    double variances[MOST];
    if (!enough(count, 9, given[3])) return NULL;
    const Py_ssize_t size = e.nuisances = PyTuple_GET_SIZE(given[3]);
    const Py_ssize_t components = PyTuple_Check(given[4]) ? PyTuple_GET_SIZE(given[4]) : 0;
    const long states = PyLong_AsLong(given[8]);
    if (states == -1 && PyErr_Occurred()) return NULL;
    if (components < 1 || components > COMPONENTS || states < 0 || states > STATES) {
        PyErr_SetString(PyExc_ValueError,
                        "expected one or two components and at most three states");
        return NULL;
    }
    if (!read_vector(given[0], STATES, e.x) ||
        !read_matrix(given[1], STATES, STATES, STATES, &e.P[0][0]) ||
        !read_matrix(given[2], STATES, size, MOST, &e.cross[0][0]) ||
        !read_vector(given[3], size, variances) || !read_vector(given[4], components, z.y) ||
        !read_matrix(given[5], components, STATES, STATES, &z.H[0][0]) ||
        !read_matrix(given[6], components, size, MOST, &z.G[0][0]) ||
        !read_matrix(given[7], components, components, COMPONENTS, &z.R[0][0]))
        return NULL;

    if (!(components == 1 ? with_one : with_two)(&e, variances, &z, (int)states)) {
        PyErr_SetString(PyExc_ZeroDivisionError, "the covariance of the innovations is singular");
        return NULL;
    }

    /* the lower triangle, mirrored */
    for (int i = 0; i < STATES; i++)
        for (int j = 0; j < i; j++) e.P[j][i] = e.P[i][j];

    PyObject *x = made_vector(e.x, STATES), *P = made_matrix(&e.P[0][0], STATES, STATES, STATES);
    PyObject *cross = made_matrix(&e.cross[0][0], STATES, size, MOST);
    PyObject *all = x && P && cross ? PyTuple_Pack(3, x, P, cross) : NULL;
    Py_XDECREF(x);
    Py_XDECREF(P);
    Py_XDECREF(cross);
    return all;
}

static PyMethodDef methods[] = {
    {"dot", (PyCFunction)(void (*)(void))dot_of, METH_FASTCALL, dot_doc},
    {"variance", (PyCFunction)(void (*)(void))variance, METH_FASTCALL, variance_doc},
    {"update", (PyCFunction)(void (*)(void))update, METH_FASTCALL, update_doc},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "algebra", "The filter's algebra, compiled.", -1, methods, NULL,
    NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_algebra(void) { return PyModule_Create(&module); }
