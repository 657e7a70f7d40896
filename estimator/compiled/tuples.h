/* Tuples of floats, in and out. A reader sets an exception and returns 0 where it finds something
   else. */

#ifndef GRITD_TUPLES_H
#define GRITD_TUPLES_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

static int read_vector(PyObject *given, Py_ssize_t size, double *out) {
    if (!PyTuple_Check(given) || PyTuple_Size(given) != size) {
        PyErr_Format(PyExc_ValueError, "expected a tuple of %zd numbers", size);
        return 0;
    }
    for (Py_ssize_t n = 0; n < size; n++) {
        out[n] = PyFloat_AsDouble(PyTuple_GetItem(given, n));
        if (out[n] == -1.0 && PyErr_Occurred()) return 0;
    }
    return 1;
}

/* rows of `size` numbers, `stride` apart in out */
static int read_matrix(PyObject *given, Py_ssize_t rows, Py_ssize_t size, Py_ssize_t stride,
                       double *out) {
    if (!PyTuple_Check(given) || PyTuple_Size(given) != rows) {
        PyErr_Format(PyExc_ValueError, "expected a tuple of %zd rows", rows);
        return 0;
    }
    for (Py_ssize_t n = 0; n < rows; n++)
        if (!read_vector(PyTuple_GetItem(given, n), size, out + n * stride)) return 0;
    return 1;
}

/* `size` doubles in a bytes object, where they stand */
static int read_packed(PyObject *given, Py_ssize_t size, const double **out) {
    if (!PyBytes_Check(given) || PyBytes_Size(given) != size * (Py_ssize_t)sizeof(double)) {
        PyErr_Format(PyExc_ValueError, "expected %zd packed doubles", size);
        return 0;
    }
    *out = (const double *)PyBytes_AsString(given);
    return 1;
}

static PyObject *made_vector(const double *values, Py_ssize_t size) {
    PyObject *made = PyTuple_New(size);
    for (Py_ssize_t n = 0; made != NULL && n < size; n++) {
        PyObject *value = PyFloat_FromDouble(values[n]);
        if (value == NULL) { Py_CLEAR(made); break; }
        PyTuple_SetItem(made, n, value);
    }
    return made;
}

/* Σ aₙbₙ, term by term */
static double dot(const double *a, const double *b, Py_ssize_t size) {
    double total = 0.0;
    for (Py_ssize_t n = 0; n < size; n++) total += a[n] * b[n];
    return total;
}

#endif
