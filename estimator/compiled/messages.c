/* The heads of small chunks, as recording/walk.py finds them one by one. Messages of unpacked
   blocks: found and held against the sizes of their channels, as recording/piles.py does by the
   message index, and copied into rows, as recording/tables.py does. */

#include "sources.h"
#include <stdint.h>
#include <string.h>

#if PY_BIG_ENDIAN
#error "MCAP is little-endian, and so is what is copied here"
#endif

enum { SCHEMA = 3, CHANNEL = 4, MESSAGE = 5, CHUNK = 6, INDEX = 7 };  /* opcodes */
/* [bytes] heads; with two bytes of CDR; a place in it */
enum { RECORD = 9, HEAD = 31, LOOK = 33, LOG_TIME = 15 };
enum { CHUNK_HEAD = 53, INDEX_HEAD = 15 };             /* [bytes] of a chunk of zstd, before its data */
enum { PADDING = 7, CDR_LE = 0x0100 };                 /* as in decoding.py */
enum { NOT_FIXED = -1, UNKNOWN = -2 };                 /* in the place of a size */
#define BILLION 1000000000LL                           /* [ns/s] */

static uint64_t u64(const char *at) { uint64_t value; memcpy(&value, at, 8); return value; }
static uint16_t u16(const char *at) { uint16_t value; memcpy(&value, at, 2); return value; }
static int32_t i32(const char *at) { int32_t value; memcpy(&value, at, 4); return value; }
static uint32_t u32(const char *at) { uint32_t value; memcpy(&value, at, 4); return value; }

/* --- chunks --- */

/* The end of the message indexes from `at` on, `most` at most; -1 where that is not known. */
static Py_ssize_t behind_indexes(const char *data, Py_ssize_t at, Py_ssize_t size, Py_ssize_t most) {
    for (; most >= 0 && size - at >= INDEX_HEAD; most--) {
        if (data[at] != INDEX) return at;
        const uint64_t length = u64(data + at + 1);
        if (length != u32(data + at + 11) + 6ull || length > (uint64_t)(size - at - RECORD)) break;
        at += RECORD + (Py_ssize_t)length;
    }
    return -1;
}

static PyObject *chunks(PyObject *self, PyObject *args) {
    Py_buffer given;
    Py_ssize_t origin, most, indexes, at = 0;
    if (!PyArg_ParseTuple(args, "y*nnn", &given, &origin, &most, &indexes)) return NULL;
    const char *data = given.buf;
    PyObject *made = PyList_New(0);
    while (made != NULL && most-- > 0 && given.len - at >= CHUNK_HEAD && data[at] == CHUNK) {
        const uint64_t length = u64(data + at + 1), size = u64(data + at + 25);
        const uint64_t stored = u64(data + at + 45), room = (uint64_t)(given.len - at - CHUNK_HEAD);
        if (memcmp(data + at + 37, "\4\0\0\0zstd", 8) != 0 || size >> 62 || stored > room ||
            length != stored + CHUNK_HEAD - RECORD)
            break;
        const Py_ssize_t start = at + CHUNK_HEAD, end = start + (Py_ssize_t)stored;
        const Py_ssize_t next = behind_indexes(data, end, given.len, indexes);
        if (next < 0) break;
        PyObject *chunk = Py_BuildValue("nLLkn", origin + start, (long long)stored, (long long)size,
                                        (unsigned long)u32(data + at + 33), origin + next);
        if (chunk == NULL || PyList_Append(made, chunk) < 0) Py_CLEAR(made);
        Py_XDECREF(chunk);
        at = next;
    }
    PyBuffer_Release(&given);
    return made;
}

/* --- walk --- */

typedef struct {
    const char *data;
    Py_ssize_t length;
    const int64_t *ends, *sizes;  /* of the blocks; of a channel's messages without MCAP's head */
    Py_ssize_t blocks, channels;
    int64_t *counts, *places;     /* (channels) messages; where in `order` the next one goes */
    uint32_t *firsts, *lasts;     /* (channels) numbers */
    int rising;                   /* whether each channel's numbers do */
    int64_t *starts, *order, *cuts;
} pile;

/* The end of the record that begins at `at`; -1 where it runs over the end of its block. */
static int64_t after(const pile *p, int64_t at, int64_t end) {
    if (end - at < RECORD) return -1;
    const uint64_t length = u64(p->data + at + 1);
    return length > (uint64_t)(end - at - RECORD) ? -1 : at + RECORD + (int64_t)length;
}

/* Where the messages of a block begin, behind their definitions; -1 where that is unknown. */
static int64_t behind_definitions(const pile *p, int64_t at, int64_t end) {
    while (at >= 0 && at < end && (p->data[at] == SCHEMA || p->data[at] == CHANNEL))
        at = after(p, at, end);
    return at;
}

/* Whether the message from `at` to `next` is of a known channel and fits its fields. */
static int is_sound(const pile *p, int64_t at, int64_t next) {
    const char *head = p->data + at;
    if (head[0] != MESSAGE || next - at < HEAD || at + LOOK > p->length) return 0;
    const Py_ssize_t channel = u16(head + 9);
    const int64_t size = channel < p->channels ? p->sizes[channel] : UNKNOWN;
    if (size < 0) return size == NOT_FIXED;
    const int64_t excess = next - at - HEAD - size;
    return excess >= 0 && excess <= PADDING && u16(head + HEAD) == CDR_LE;
}

/* How many messages there are, and of each channel; -1 where messages, and nothing else, do not lie
   end to end behind the definitions of each block. */
static int64_t counted(pile *p) {
    int64_t total = 0, at = 0;
    for (Py_ssize_t block = 0; block < p->blocks; block++) {
        const int64_t end = p->ends[block], before = total;
        if (end < at || end > p->length) return -1;
        at = behind_definitions(p, at, end);
        while (at >= 0 && at < end) {
            const int64_t next = after(p, at, end);
            if (next < 0 || !is_sound(p, at, next)) return -1;
            const Py_ssize_t channel = u16(p->data + at + 9);
            const uint32_t number = u32(p->data + at + 11);
            if (p->counts[channel]++ == 0) p->firsts[channel] = number;
            else if ((int32_t)(number - p->lasts[channel]) <= 0) p->rising = 0;
            p->lasts[channel] = number;
            total++;
            at = next;
        }
        if (at < 0 || total == before) return -1;
    }
    return total;
}

static void note(pile *p, int64_t total) {
    int64_t place = 0, number = 0, at = 0;
    for (Py_ssize_t channel = 0; channel < p->channels; channel++) {
        p->places[channel] = place;
        place += p->counts[channel];
    }
    for (Py_ssize_t block = 0; block < p->blocks; block++) {
        const int64_t end = p->ends[block];
        p->cuts[block] = number;
        for (at = behind_definitions(p, at, end); at < end; at = after(p, at, end), number++) {
            p->starts[number] = at;
            p->order[p->places[u16(p->data + at + 9)]++] = number;
        }
    }
    p->cuts[p->blocks] = total;
}

/* {channel: first number, last number, messages}, ascending, of those that have any */
static PyObject *by_channel(const pile *p) {
    PyObject *made = PyDict_New();
    for (Py_ssize_t channel = 0; made != NULL && channel < p->channels; channel++) {
        if (p->counts[channel] == 0) continue;
        PyObject *key = PyLong_FromSsize_t(channel);
        PyObject *value = Py_BuildValue("kkL", (unsigned long)p->firsts[channel],
                                        (unsigned long)p->lasts[channel],
                                        (long long)p->counts[channel]);
        if (key == NULL || value == NULL || PyDict_SetItem(made, key, value) < 0) Py_CLEAR(made);
        Py_XDECREF(key);
        Py_XDECREF(value);
    }
    return made;
}

static PyObject *noted(pile *p) {
    p->counts = PyMem_Calloc(3 * (size_t)p->channels + 1, sizeof(int64_t));
    if (p->counts == NULL) return PyErr_NoMemory();
    p->places = p->counts + p->channels;
    p->firsts = (uint32_t *)(p->places + p->channels);
    p->lasts = p->firsts + p->channels;
    const int64_t total = counted(p);
    if (total < 0) { PyMem_Free(p->counts); Py_RETURN_NONE; }

    PyObject *made = NULL, *counts = by_channel(p);
    PyObject *starts = PyBytes_FromStringAndSize(NULL, total * 8);
    PyObject *order = PyBytes_FromStringAndSize(NULL, total * 8);
    PyObject *cuts = PyBytes_FromStringAndSize(NULL, (p->blocks + 1) * 8);
    if (counts && starts && order && cuts) {
        p->starts = (int64_t *)PyBytes_AsString(starts);
        p->order = (int64_t *)PyBytes_AsString(order);
        p->cuts = (int64_t *)PyBytes_AsString(cuts);
        note(p, total);
        made = PyTuple_Pack(5, starts, cuts, order, counts, p->rising ? Py_True : Py_False);
    }
    Py_XDECREF(starts); Py_XDECREF(order); Py_XDECREF(cuts); Py_XDECREF(counts);
    PyMem_Free(p->counts);
    return made;
}

static PyObject *walk(PyObject *self, PyObject *args) {
    Py_buffer content, ends, sizes;
    if (!PyArg_ParseTuple(args, "y*y*y*", &content, &ends, &sizes)) return NULL;
    pile p = {.data = content.buf, .length = content.len, .ends = ends.buf, .sizes = sizes.buf,
              .blocks = ends.len / 8, .channels = sizes.len / 8, .rising = 1};
    PyObject *made = noted(&p);
    PyBuffer_Release(&content); PyBuffer_Release(&ends); PyBuffer_Release(&sizes);
    return made;
}

/* --- fill --- */

/* n triples of places: bytes of a record that become bytes of a row, or seconds and nanoseconds
   that become a time */
typedef struct { Py_ssize_t from, to, other; } step;

static step *read_steps(PyObject *given, Py_ssize_t *n) {
    if (!PyTuple_Check(given)) {
        PyErr_SetString(PyExc_TypeError, "expected a tuple of triples");
        return NULL;
    }
    *n = PyTuple_Size(given);
    step *steps = PyMem_Calloc((size_t)*n + 1, sizeof(step));
    if (steps == NULL) { PyErr_NoMemory(); return NULL; }
    for (Py_ssize_t i = 0; i < *n; i++)
        if (!PyArg_ParseTuple(PyTuple_GetItem(given, i), "nnn", &steps[i].from, &steps[i].to,
                              &steps[i].other)) {
            PyMem_Free(steps);
            return NULL;
        }
    return steps;
}

/* Whether all that is read of a record lies within `reach` of its start, and all that is written
   within a row. */
static int fits(const step *pieces, Py_ssize_t n, const step *times, Py_ssize_t m, Py_ssize_t reach,
                Py_ssize_t row) {
    for (Py_ssize_t i = 0; i < n; i++) {
        const step s = pieces[i];
        if (s.from < 0 || s.to < 0 || s.other < 0 || s.other > reach - s.from ||
            s.other > row - s.to)
            return 0;
    }
    for (Py_ssize_t i = 0; i < m; i++) {
        const step s = times[i];
        if (s.from < 0 || s.to < 0 || s.other < 0 || s.from > reach - 4 || s.other > reach - 4 ||
            s.to > row - 8)
            return 0;
    }
    return row >= 16 && reach >= HEAD;
}

static void copy(const char *record, char *row, const step *pieces, Py_ssize_t n, const step *times,
                 Py_ssize_t m) {
    for (Py_ssize_t i = 0; i < n; i++) {
        if (pieces[i].other == 8) memcpy(row + pieces[i].to, record + pieces[i].from, 8);
        else memcpy(row + pieces[i].to, record + pieces[i].from, (size_t)pieces[i].other);
    }
    for (Py_ssize_t i = 0; i < m; i++) {
        const int64_t time = i32(record + times[i].from) * BILLION + u32(record + times[i].other);
        memcpy(row + times[i].to, &time, 8);
    }
}

static PyObject *fill(PyObject *self, PyObject *args) {
    Py_buffer content, starts, own, rows;
    Py_ssize_t reach, n = 0, m = 0;
    long long before;
    PyObject *given_pieces, *given_times, *made = NULL;
    if (!PyArg_ParseTuple(args, "y*y*y*w*nLOO", &content, &starts, &own, &rows, &reach, &before,
                          &given_pieces, &given_times))
        return NULL;
    const int64_t *start = starts.buf, *number = own.buf;
    const Py_ssize_t count = own.len / 8, messages = starts.len / 8;
    const Py_ssize_t row = count ? rows.len / count : 16;
    step *pieces = read_steps(given_pieces, &n);
    step *times = pieces ? read_steps(given_times, &m) : NULL;
    if (times == NULL) goto done;
    if (!fits(pieces, n, times, m, reach, row)) {
        PyErr_SetString(PyExc_ValueError, "a piece lies outside its record or its row");
        goto done;
    }
    for (Py_ssize_t i = 0; i < count; i++) {
        const int64_t at = number[i] >= 0 && number[i] < messages ? start[number[i]] : -1;
        if (at < 0 || at > content.len - reach) {
            PyErr_SetString(PyExc_ValueError, "a message lies outside its block");
            goto done;
        }
        const char *record = (const char *)content.buf + at;
        char *into = (char *)rows.buf + i * row;
        const int64_t order = number[i] + before;
        memcpy(into, record + LOG_TIME, 8);
        memcpy(into + 8, &order, 8);
        copy(record, into, pieces, n, times, m);
    }
    made = Py_NewRef(Py_None);
done:
    PyMem_Free(pieces);
    PyMem_Free(times);
    PyBuffer_Release(&content);
    PyBuffer_Release(&starts);
    PyBuffer_Release(&own);
    PyBuffer_Release(&rows);
    return made;
}

static PyMethodDef methods[] = {
    {"chunks", chunks, METH_VARARGS,
     "chunks(data, origin, most, indexes): the chunks of zstd that lie end to end from the start of\n"
     "`data`, which stands at `origin` in its file, each whole with its message indexes: tuples of\n"
     "where its data begin, stored bytes, unpacked bytes, checksum, the end of its indexes."},
    {"walk", walk, METH_VARARGS,
     "walk(content, ends, sizes): the messages of joined blocks that end at `ends` (n,) int64,\n"
     "each behind its definitions. sizes: int64 by channel, of a message without MCAP's head; -1\n"
     "not fixed, -2 unknown. As bytes, int64: starts (m,), cuts (n + 1,), places by channel (m,);\n"
     "{channel: first number, last number, messages}; and whether each has a later number than the\n"
     "one of its channel before it. None where anything is not as it should be."},
    {"fill", fill, METH_VARARGS,
     "fill(content, starts, own, rows, reach, before, pieces, times): the messages numbered `own`\n"
     "(m,) int64 as rows that begin with log_time and order. pieces: (place in the record, in the\n"
     "row, bytes); times: (place of the seconds, in the row, of the nanoseconds). reach: bytes of\n"
     "a record that are looked at."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "messages", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_messages(void) { return made_of_these_sources(&module); }
