/* Whether the soil changed: the Bayes factors of filter/evidence.py, operation for operation, to
   the same bits. */

#include "sources.h"
#include "tuples.h"
#include <math.h>

#define STATES 3
#define COMPONENTS 2
#define TINY 1e-9                 /* as in evidence.py */

/* A record of s stretches of a vector (d,); d normals are the prior. */
typedef struct {
    Py_ssize_t s, d;
    double *A;                    /* (s, 2, d) H of unit noise */
    double *y;                    /* (s, 2) */
    double *F;                    /* (s, 2, d) of the normals */
    double *root, *gram, *factor; /* (d, d) */
    double *best, *sigma, *scale, *x; /* (d,) */
    double *shared, *V;           /* (d, 3) sums from a stretch to the last */
    double spread[STATES];
    double own;                   /* error of a stretch alone, in shares of the load */
    double *block;                /* that all of these lie in */
} record;

static int room(record *r) {
    const Py_ssize_t d = r->d, rows = COMPONENTS * r->s;
    const Py_ssize_t size = rows * (2 * d + 1) + 3 * d * d + 4 * d + 2 * d * STATES;
    double *next = r->block = PyMem_Calloc((size_t)size, sizeof(double));
    if (next == NULL) { PyErr_NoMemory(); return 0; }
    r->A = next; next += rows * d;
    r->F = next; next += rows * d;
    r->y = next; next += rows;
    r->root = next; next += d * d;
    r->gram = next; next += d * d;
    r->factor = next; next += d * d;
    r->best = next; next += d;
    r->sigma = next; next += d;
    r->scale = next; next += d;
    r->x = next; next += d;
    r->shared = next; next += d * STATES;
    r->V = next;
    return 1;
}

/* --- what is given --- */

/* One line with unit noise: rows of H, and y. */
static int read_line(record *r, Py_ssize_t at, PyObject *line, double windows) {
    const Py_ssize_t d = r->d;
    double *A = r->A + COMPONENTS * at * d, *y = r->y + COMPONENTS * at;
    double R[COMPONENTS][COMPONENTS], D[COMPONENTS][COMPONENTS], share[COMPONENTS];
    if (!PyTuple_Check(line) || PyTuple_Size(line) != 5 ||
        !PyTuple_Check(PyTuple_GetItem(line, 0))) {
        PyErr_SetString(PyExc_ValueError, "expected a line of y, H, R, D and shares");
        return 0;
    }
    const Py_ssize_t m = PyTuple_Size(PyTuple_GetItem(line, 0));
    if (m < 1 || m > COMPONENTS) {
        PyErr_SetString(PyExc_ValueError, "expected one or two components");
        return 0;
    }
    if (!read_vector(PyTuple_GetItem(line, 0), m, y) ||
        !read_matrix(PyTuple_GetItem(line, 1), m, d, d, A) ||
        !read_matrix(PyTuple_GetItem(line, 2), m, m, COMPONENTS, &R[0][0]) ||
        !read_matrix(PyTuple_GetItem(line, 3), m, m, COMPONENTS, &D[0][0]) ||
        !read_vector(PyTuple_GetItem(line, 4), m, share))
        return 0;
    for (Py_ssize_t n = 0; n < m; n++)
        D[n][n] = D[n][n] + (r->own * share[n]) * (r->own * share[n]);

    const double first = sqrt(R[0][0] / windows + D[0][0]);
    for (Py_ssize_t n = 0; n < d; n++) A[n] = A[n] / first;
    y[0] = y[0] / first;
    if (m == 1) return 1;

    const double slope = (R[1][0] / windows + D[1][0]) / first;
    const double second = sqrt(R[1][1] / windows + D[1][1] - slope * slope);
    for (Py_ssize_t n = 0; n < d; n++) A[d + n] = (A[d + n] - slope * A[n]) / second;
    y[1] = (y[1] - slope * y[0]) / second;
    return 1;
}

static int read_lines(record *r, PyObject *lines, PyObject *windows) {
    for (Py_ssize_t at = 0; at < r->s; at++) {
        const double count = PyFloat_AsDouble(PyList_GetItem(windows, at));
        if (count == -1.0 && PyErr_Occurred()) return 0;
        if (!read_line(r, at, PyList_GetItem(lines, at), count)) return 0;
    }
    return 1;
}

/* --- roots and solutions --- */

static int cholesky(const double *A, double *L, Py_ssize_t d) {
    for (Py_ssize_t i = 0; i < d; i++)
        for (Py_ssize_t j = 0; j <= i; j++) {
            const double left = A[i * d + j] - dot(L + i * d, L + j * d, j);
            if (i == j && !(left > 0.0)) {
                PyErr_SetString(PyExc_ValueError, "a covariance is not positive definite");
                return 0;
            }
            L[i * d + j] = i == j ? sqrt(left) : left / L[j * d + j];
        }
    return 1;
}

/* A root of the covariance. */
static int root_of(record *r, PyObject *packed) {
    const Py_ssize_t d = r->d;
    double *joint = r->gram;
    const double *P;
    if (!read_packed(packed, d * d, &P)) return 0;
    memcpy(joint, P, (size_t)(d * d) * sizeof(double));
    for (Py_ssize_t i = 0; i < d; i++) {
        r->sigma[i] = sqrt(joint[i * d + i]);
        r->scale[i] = r->sigma[i] > 0.0 ? r->sigma[i] : 1.0;
    }
    for (Py_ssize_t i = 0; i < d; i++)
        for (Py_ssize_t j = 0; j < d; j++)
            joint[i * d + j] =
                joint[i * d + j] / (r->scale[i] * r->scale[j]) + (i == j ? TINY : 0.0);
    if (!cholesky(joint, r->root, d)) return 0;
    for (Py_ssize_t i = 0; i < d; i++)
        for (Py_ssize_t j = 0; j < d; j++) r->root[i * d + j] = r->sigma[i] * r->root[i * d + j];
    return 1;
}

/* One soil for all: the normals that fit best. */
static int fitted(record *r) {
    const Py_ssize_t d = r->d, rows = COMPONENTS * r->s;
    for (Py_ssize_t row = 0; row < rows; row++) {
        const double *A = r->A + row * d;
        double *F = r->F + row * d;
        r->y[row] = r->y[row] - dot(A, r->x, d);
        for (Py_ssize_t n = 0; n < d; n++)
            for (Py_ssize_t j = 0; j <= n; j++) F[j] += A[n] * r->root[n * d + j];
    }
    memset(r->gram, 0, (size_t)(d * d) * sizeof(double));
    memset(r->best, 0, (size_t)d * sizeof(double));
    for (Py_ssize_t row = 0; row < rows; row++) {
        const double *F = r->F + row * d;
        for (Py_ssize_t i = 0; i < d; i++) {
            for (Py_ssize_t j = 0; j <= i; j++) r->gram[i * d + j] += F[i] * F[j];
            r->best[i] += F[i] * r->y[row];
        }
    }
    for (Py_ssize_t i = 0; i < d; i++) r->gram[i * d + i] = 1.0 + r->gram[i * d + i];
    if (!cholesky(r->gram, r->factor, d)) return 0;

    const double *L = r->factor;
    double *x = r->best;
    for (Py_ssize_t i = 0; i < d; i++) {
        for (Py_ssize_t k = 0; k < i; k++) x[i] -= L[i * d + k] * x[k];
        x[i] /= L[i * d + i];
    }
    for (Py_ssize_t i = d - 1; i >= 0; i--) {
        for (Py_ssize_t k = i + 1; k < d; k++) x[i] -= L[k * d + i] * x[k];
        x[i] /= L[i * d + i];
    }
    return 1;
}

/* --- a change on top of it, from each stretch on --- */

/* ln of the Bayes factor of a change with unit normal prior. */
static double bayes(const double I[STATES][STATES], const double score[STATES]) {
    const double a = 1.0 + I[0][0], b = I[1][0], c = I[2][0];
    double m = b / a, n = c / a;
    const double d = 1.0 + I[1][1] - m * b, e = I[2][1] - n * b;
    double f = 1.0 + I[2][2] - n * c;
    const double one = score[0], two = score[1] - m * one;
    double three = score[2] - n * one;
    m = e / d;
    f = f - m * e;
    three = three - m * two;
    return 0.5 * (one * one / a + two * two / d + three * three / f - log(a * d * f));
}

static void since(record *r, double *evidence) {
    const Py_ssize_t d = r->d;
    double information[STATES][STATES] = {{0.0}}, score[STATES] = {0.0}, left[STATES][STATES];
    for (Py_ssize_t at = r->s - 1; at >= 0; at--) {
        const double *A = r->A + COMPONENTS * at * d, *B = A + d;
        const double *F = r->F + COMPONENTS * at * d, *E = F + d;
        const double *y = r->y + COMPONENTS * at;
        const double y_a = y[0] - dot(F, r->best, d), y_b = y[1] - dot(E, r->best, d);
        for (int i = 0; i < STATES; i++) {
            const double a = A[i] * r->spread[i], b = B[i] * r->spread[i];
            for (int j = 0; j < STATES; j++)
                information[i][j] += a * (A[j] * r->spread[j]) + b * (B[j] * r->spread[j]);
            for (Py_ssize_t n = 0; n < d; n++) r->shared[n * STATES + i] += F[n] * a + E[n] * b;
            score[i] += a * y_a + b * y_b;
        }
        memcpy(left, information, sizeof left);
        double explained[STATES][STATES] = {{0.0}};
        for (Py_ssize_t n = 0; n < d; n++) {
            double *V = r->V + n * STATES;
            const double *L = r->factor + n * d;
            memcpy(V, r->shared + n * STATES, STATES * sizeof(double));
            for (Py_ssize_t k = 0; k < n; k++)
                for (int i = 0; i < STATES; i++) V[i] -= L[k] * r->V[k * STATES + i];
            for (int i = 0; i < STATES; i++) V[i] /= L[n];
            for (int i = 0; i < STATES; i++)
                for (int j = 0; j < STATES; j++) explained[i][j] += V[i] * V[j];
        }
        for (int i = 0; i < STATES; i++)
            for (int j = 0; j < STATES; j++) left[i][j] = information[i][j] - explained[i][j];
        evidence[at] = bayes(left, score);
    }
}

PyDoc_STRVAR(evidence_doc,
"evidence(x, P, spread, lines, windows, own)\n--\n\nSee filter/evidence.py.");

static PyObject *evidence(PyObject *module, PyObject *const *given, Py_ssize_t count) {
    (void)module;
    record r = {0};
    PyObject *factors = NULL, *x = NULL, *all = NULL;
    if (count != 6 || !PyTuple_Check(given[0]) || !PyList_Check(given[3]) ||
        !PyList_Check(given[4]) || PyList_Size(given[3]) != PyList_Size(given[4])) {
        PyErr_SetString(PyExc_TypeError, "expected an estimate, a spread, two lists of one length, and a share");
        return NULL;
    }
    r.s = PyList_Size(given[3]);
    r.d = PyTuple_Size(given[0]);
    r.own = PyFloat_AsDouble(given[5]);
    if ((r.own == -1.0 && PyErr_Occurred()) || !room(&r)) return NULL;
    double *factor = PyMem_Calloc((size_t)r.s + 1, sizeof(double));
    if (factor != NULL && r.d >= STATES && read_vector(given[0], r.d, r.x) &&
        read_vector(given[2], STATES, r.spread) && read_lines(&r, given[3], given[4]) &&
        root_of(&r, given[1]) && fitted(&r)) {
        since(&r, factor);
        for (Py_ssize_t n = 0; n < r.d; n++)
            r.x[n] = r.x[n] + dot(r.root + n * r.d, r.best, r.d);
        factors = made_vector(factor, r.s);
        x = made_vector(r.x, r.d);
        all = factors && x ? PyTuple_Pack(2, factors, x) : NULL;
    } else if (factor == NULL) {
        PyErr_NoMemory();
    } else if (!PyErr_Occurred()) {
        PyErr_SetString(PyExc_ValueError, "expected c, tan phi and ln k at least");
    }
    PyMem_Free(factor);
    PyMem_Free(r.block);
    Py_XDECREF(factors);
    Py_XDECREF(x);
    return all;
}

static PyMethodDef methods[] = {
    {"evidence", (PyCFunction)(void (*)(void))evidence, METH_FASTCALL, evidence_doc},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "record", "Whether the soil changed, compiled.", -1, methods, NULL,
    NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_record(void) { return made_of_these_sources(&module); }
