/* The filter's algebra: the variance of a predicted quantity, the update with one or two
   components, the moments of a mixture.

   This is filter/estimate.py and filter/plain_engine.py, operation for operation: the same bits. No
   sum is reordered and no product fused with a sum (-ffp-contract=off). A test compares the two on
   drawn values. */

#include "sources.h"
#include "tuples.h"
#include <math.h>

#define COMPONENTS 2
#define MOST 256                  /* entries of the vector */

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
    const Py_ssize_t one = PyTuple_Size(given[0]), other = PyTuple_Size(given[1]);
    double total = 0.0;
    for (Py_ssize_t n = 0; n < (one < other ? one : other); n++) {
        const double a = PyFloat_AsDouble(PyTuple_GetItem(given[0], n));
        const double b = PyFloat_AsDouble(PyTuple_GetItem(given[1], n));
        if ((a == -1.0 || b == -1.0) && PyErr_Occurred()) return NULL;
        total += a * b;
    }
    return PyFloat_FromDouble(total);
}

/* out = P h of a symmetric P, row after row */
static void times(const double *P, const double *h, Py_ssize_t d, double *out) {
    for (Py_ssize_t i = 0; i < d; i++) out[i] = P[i] * h[0];
    for (Py_ssize_t j = 1; j < d; j++)
        for (Py_ssize_t i = 0; i < d; i++) out[i] += P[j * d + i] * h[j];
}

PyDoc_STRVAR(variance_doc, "variance(P, h)\n--\n\nSee filter/estimate.py.");

static PyObject *variance(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    double h[MOST], m[MOST];
    const double *P;
    if (count != 2 || !PyTuple_Check(given[1]) || PyTuple_Size(given[1]) < 1 ||
        PyTuple_Size(given[1]) > MOST) {
        PyErr_SetString(PyExc_TypeError, "expected a covariance and a gradient");
        return NULL;
    }
    const Py_ssize_t d = PyTuple_Size(given[1]);
    if (!read_packed(given[0], d * d, &P) || !read_vector(given[1], d, h)) return NULL;

    times(P, h, d, m);
    const double all = dot(h, m, d);
    return PyFloat_FromDouble(0.0 > all ? 0.0 : all);
}

PyDoc_STRVAR(update_doc, "update(x, P, innovation, H, R)\n--\n\nSee filter/plain_engine.py.");

static PyObject *update(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    double x[MOST], y[COMPONENTS], H[COMPONENTS][MOST], R[COMPONENTS][COMPONENTS];
    double m[COMPONENTS][MOST], u[COMPONENTS][MOST], s[COMPONENTS], score[COMPONENTS];
    const double *P;
    if (count != 5 || !PyTuple_Check(given[0]) || !PyTuple_Check(given[2]) ||
        PyTuple_Size(given[0]) < 1 || PyTuple_Size(given[0]) > MOST ||
        PyTuple_Size(given[2]) < 1 || PyTuple_Size(given[2]) > COMPONENTS) {
        PyErr_SetString(PyExc_ValueError, "expected an estimate and one or two components");
        return NULL;
    }
    const Py_ssize_t d = PyTuple_Size(given[0]), components = PyTuple_Size(given[2]);
    if (!read_vector(given[0], d, x) || !read_packed(given[1], d * d, &P) ||
        !read_vector(given[2], components, y) || !read_matrix(given[3], components, d, MOST, H[0]) ||
        !read_matrix(given[4], components, components, COMPONENTS, R[0]))
        return NULL;

    /* component by component, each less what it shares with the one before */
    double logs = 0.0, squares = 0.0;
    for (Py_ssize_t at = 0; at < components; at++) {
        times(P, H[at], d, m[at]);
        double rest = dot(H[at], m[at], d) + R[at][at], left = y[at];
        memcpy(u[at], m[at], (size_t)d * sizeof(double));
        for (Py_ssize_t n = 0; n < at; n++) {
            const double slope = (dot(H[at], m[n], d) + R[at][n]) / s[n];
            rest = rest - slope * slope;
            left = left - slope * score[n];
            for (Py_ssize_t i = 0; i < d; i++) u[at][i] = u[at][i] - slope * u[n][i];
        }
        if (!(rest > 0.0)) {
            PyErr_SetString(PyExc_ZeroDivisionError,
                            "the covariance of the innovations is singular");
            return NULL;
        }
        s[at] = sqrt(rest);
        for (Py_ssize_t i = 0; i < d; i++) u[at][i] = u[at][i] / s[at];
        score[at] = left / s[at];
        logs += log(s[at]);
        squares += score[at] * score[at];
    }

    PyObject *packed = PyBytes_FromStringAndSize(NULL, d * d * (Py_ssize_t)sizeof(double));
    if (packed == NULL) return NULL;
    double *after = (double *)PyBytes_AsString(packed);
    memcpy(after, P, (size_t)(d * d) * sizeof(double));
    for (Py_ssize_t n = 0; n < components; n++) {
        for (Py_ssize_t i = 0; i < d; i++) x[i] = x[i] + u[n][i] * score[n];
        for (Py_ssize_t i = 0; i < d; i++)
            for (Py_ssize_t j = 0; j < d; j++)
                after[i * d + j] = after[i * d + j] - u[n][i] * u[n][j];
    }
    PyObject *mean = made_vector(x, d), *evidence = PyFloat_FromDouble(-0.5 * squares - logs);
    PyObject *all = mean && evidence ? PyTuple_Pack(3, mean, packed, evidence) : NULL;
    Py_XDECREF(mean);
    Py_XDECREF(evidence);
    Py_DECREF(packed);
    return all;
}

PyDoc_STRVAR(mixed_doc, "mixed(members, weights)\n--\n\nSee filter/estimate.py.");

static PyObject *mixed(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    double x[MOST] = {0.0}, own[MOST], off[MOST];
    if (count != 2 || !PyList_Check(given[0]) || !PyTuple_Check(given[1]) ||
        PyList_Size(given[0]) < 1 ||
        PyList_Size(given[0]) != PyTuple_Size(given[1])) {
        PyErr_SetString(PyExc_TypeError, "expected a list of estimates and as many weights");
        return NULL;
    }
    const Py_ssize_t members = PyList_Size(given[0]);
    Py_ssize_t d = 0;
    for (Py_ssize_t n = 0; n < members; n++) {
        PyObject *member = PyList_GetItem(given[0], n);
        const int pair = PyTuple_Check(member) && PyTuple_Size(member) == 2 &&
                         PyTuple_Check(PyTuple_GetItem(member, 0));
        if (pair && n == 0) d = PyTuple_Size(PyTuple_GetItem(member, 0));
        if (!pair || d < 1 || d > MOST) {
            PyErr_SetString(PyExc_ValueError, "expected pairs of a mean and a covariance");
            return NULL;
        }
        const double weight = PyFloat_AsDouble(PyTuple_GetItem(given[1], n));
        if (weight == -1.0 && PyErr_Occurred()) return NULL;
        if (!read_vector(PyTuple_GetItem(member, 0), d, own)) return NULL;
        for (Py_ssize_t i = 0; i < d; i++) x[i] = x[i] + weight * own[i];
    }

    PyObject *packed = PyBytes_FromStringAndSize(NULL, d * d * (Py_ssize_t)sizeof(double));
    if (packed == NULL) return NULL;
    double *P = (double *)PyBytes_AsString(packed);
    for (Py_ssize_t i = 0; i < d * d; i++) P[i] = 0.0;
    for (Py_ssize_t n = 0; n < members; n++) {
        PyObject *member = PyList_GetItem(given[0], n);
        const double weight = PyFloat_AsDouble(PyTuple_GetItem(given[1], n));
        const double *added;
        if (!read_vector(PyTuple_GetItem(member, 0), d, own) ||
            !read_packed(PyTuple_GetItem(member, 1), d * d, &added)) {
            Py_DECREF(packed);
            return NULL;
        }
        for (Py_ssize_t i = 0; i < d; i++) off[i] = own[i] - x[i];
        for (Py_ssize_t i = 0; i < d; i++)
            for (Py_ssize_t j = 0; j < d; j++)
                P[i * d + j] = P[i * d + j] + weight * (added[i * d + j] + off[i] * off[j]);
    }
    PyObject *mean = made_vector(x, d);
    PyObject *all = mean ? PyTuple_Pack(2, mean, packed) : NULL;
    Py_XDECREF(mean);
    Py_DECREF(packed);
    return all;
}

PyDoc_STRVAR(total_doc, "total(values)\n--\n\nSum of a list, term by term.");

static PyObject *total_of(PyObject *module, PyObject *given) {
    if (!PyList_Check(given)) {
        PyErr_SetString(PyExc_ValueError, "expected a list of numbers");
        return NULL;
    }
    double total = 0.0;
    for (Py_ssize_t n = 0; n < PyList_Size(given); n++) {
        const double value = PyFloat_AsDouble(PyList_GetItem(given, n));
        if (value == -1.0 && PyErr_Occurred()) return NULL;
        total += value;
    }
    return PyFloat_FromDouble(total);
}

static PyMethodDef methods[] = {
    {"total", total_of, METH_O, total_doc},
    {"dot", (PyCFunction)(void (*)(void))dot_of, METH_FASTCALL, dot_doc},
    {"variance", (PyCFunction)(void (*)(void))variance, METH_FASTCALL, variance_doc},
    {"update", (PyCFunction)(void (*)(void))update, METH_FASTCALL, update_doc},
    {"mixed", (PyCFunction)(void (*)(void))mixed, METH_FASTCALL, mixed_doc},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "algebra", "The filter's algebra, compiled.", -1, methods, NULL,
    NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_algebra(void) { return made_of_these_sources(&module); }
