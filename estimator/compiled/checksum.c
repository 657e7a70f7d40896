/* CRC-32 of zlib, the checksum of MCAP's chunks, four times faster where the processor multiplies
   without carries.

   V. Gopal et al., Fast CRC computation for generic polynomials using the PCLMULQDQ instruction,
   Intel 2009: 64 bytes at a time are folded into the next 64; the bit-reflected constants are those
   of its last page. */

#include "sources.h"
#include <stdint.h>

#if !defined(__x86_64__)
#error "for x86-64; elsewhere zlib does it"
#endif
#include <immintrin.h>

#define POLYNOMIAL 0xedb88320u  /* reflected */
enum { LEAST = 64, STEP = 16 }; /* [bytes] */

/* One byte after the other: what is left over. */
static uint32_t by_bytes(const unsigned char *data, Py_ssize_t size, uint32_t crc) {
    for (Py_ssize_t i = 0; i < size; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? POLYNOMIAL : 0);
    }
    return crc;
}

__attribute__((target("pclmul,sse4.1")))
static inline __m128i folded(__m128i x, __m128i k, __m128i next) {
    const __m128i low = _mm_clmulepi64_si128(x, k, 0x00), high = _mm_clmulepi64_si128(x, k, 0x11);
    return _mm_xor_si128(_mm_xor_si128(low, high), next);
}

#define AT(place) _mm_loadu_si128((const __m128i *)(data + (place)))

/* The same of 64 bytes or more, in steps of 16. */
__attribute__((target("pclmul,sse4.1")))
static uint32_t by_folding(const unsigned char *data, Py_ssize_t size, uint32_t crc) {
    const __m128i k64 = _mm_set_epi64x(0x01c6e41596, 0x0154442bd4);
    const __m128i k16 = _mm_set_epi64x(0x00ccaa009e, 0x01751997d0);
    const __m128i k8 = _mm_set_epi64x(0, 0x0163cd6124);
    const __m128i barrett = _mm_set_epi64x(0x01f7011641, 0x01db710641);
    const __m128i words = _mm_setr_epi32(~0, 0, ~0, 0);
    __m128i a = _mm_xor_si128(AT(0), _mm_cvtsi32_si128((int)crc)), b = AT(16);
    __m128i c = AT(32), d = AT(48);
    for (data += 64, size -= 64; size >= 64; data += 64, size -= 64) {
        a = folded(a, k64, AT(0));
        b = folded(b, k64, AT(16));
        c = folded(c, k64, AT(32));
        d = folded(d, k64, AT(48));
    }
    a = folded(folded(folded(a, k16, b), k16, c), k16, d);
    for (; size >= STEP; data += STEP, size -= STEP) a = folded(a, k16, AT(0));

    /* 128 bits to 64, to 32 */
    a = _mm_xor_si128(_mm_srli_si128(a, 8), _mm_clmulepi64_si128(a, k16, 0x10));
    a = _mm_xor_si128(_mm_srli_si128(a, 4),
                      _mm_clmulepi64_si128(_mm_and_si128(a, words), k8, 0x00));
    b = _mm_and_si128(_mm_clmulepi64_si128(_mm_and_si128(a, words), barrett, 0x10), words);
    return (uint32_t)_mm_extract_epi32(_mm_xor_si128(a, _mm_clmulepi64_si128(b, barrett, 0x00)), 1);
}

static PyObject *crc32(PyObject *self, PyObject *given) {
    Py_buffer data;
    if (PyObject_GetBuffer(given, &data, PyBUF_SIMPLE) < 0) return NULL;
    uint32_t crc = ~0u;
    Py_BEGIN_ALLOW_THREADS
    const Py_ssize_t whole = data.len < LEAST ? 0 : data.len - data.len % STEP;
    if (whole) crc = by_folding(data.buf, whole, crc);
    crc = ~by_bytes((const unsigned char *)data.buf + whole, data.len - whole, crc);
    Py_END_ALLOW_THREADS
    PyBuffer_Release(&data);
    return PyLong_FromUnsignedLong(crc);
}

static PyMethodDef methods[] = {
    {"crc32", crc32, METH_O, "crc32(data): as zlib.crc32."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "checksum", "CRC-32, folded.", -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_checksum(void) {
    if (!__builtin_cpu_supports("pclmul") || !__builtin_cpu_supports("sse4.1")) {
        PyErr_SetString(PyExc_ImportError, "this processor has no PCLMULQDQ");
        return NULL;
    }
    return made_of_these_sources(&module);
}
