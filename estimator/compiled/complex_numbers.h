/* Complex numbers, multiplied, divided and raised as CPython does. */

#ifndef GRITD_COMPLEX_NUMBERS_H
#define GRITD_COMPLEX_NUMBERS_H

#include <math.h>

typedef struct { double re, im; } number;

static number plus(number a, number b) { return (number){a.re + b.re, a.im + b.im}; }
static number minus(number a, number b) { return (number){a.re - b.re, a.im - b.im}; }
static number real(double a) { return (number){a, 0.0}; }

static number times(number a, number b) {
    return (number){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static number over(number a, number b) {
    if (fabs(b.re) >= fabs(b.im)) {
        const double ratio = b.im / b.re, whole = b.re + b.im * ratio;
        return (number){(a.re + a.im * ratio) / whole, (a.im - a.re * ratio) / whole};
    }
    const double ratio = b.re / b.im, whole = b.re * ratio + b.im;
    return (number){(a.re * ratio + a.im) / whole, (a.im * ratio - a.re) / whole};
}

static number turn(number a) {
    const double size = exp(a.re);
    return (number){size * cos(a.im), size * sin(a.im)};
}

#endif
