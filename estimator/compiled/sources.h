/* The number of the sources that a module was built from, which setup.py defines. */

#ifndef GRITD_SOURCES_H
#define GRITD_SOURCES_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

static PyObject *made_of_these_sources(struct PyModuleDef *definition) {
    PyObject *made = PyModule_Create(definition), *number = PyLong_FromUnsignedLong(SOURCES);
    if (made != NULL && PyModule_AddObjectRef(made, "SOURCES", number) < 0) Py_CLEAR(made);
    Py_XDECREF(number);
    return made;
}

#endif
