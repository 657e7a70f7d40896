"""Least divisors and least sizes: they keep a quotient finite where a recording holds nothing.

They are no tuned numbers: whatever is measured lies orders of magnitude above them, so no result
follows their value. The last is fine enough that no printed digit does.
"""

SPAN = 1e-9  # of a length of time [s], a way [m], an angle [rad], a load [N], a share, or nats
SQUARE = 1e-300  # of a sum of squares or a variance: just above what a float can hold
RIDGE = 1e-9  # of the mean square of normal equations: above their rounding
SIZE = 1e-12  # of a value's size, in the value's unit
SLIGHT = 1e-6  # of an angle [rad], a turning speed [rad/s], or a noise in that of its channel
SPEED = 1e-4  # of a wheel's rim that drives [m/s]
WAY = 1e-3  # of the bed that was driven [m]
UNCHANGED = 1e-8  # of a channel's largest value: above what a vertical balance is solved to
ROUNDING = 1e-9  # of a fit's unknown, in its prior σ: nearer to a bound it is on it
DEPENDENT = 1e-6  # of the largest singular value: columns that do the same
DAMPING_LEAST = 1e-7  # of a descent's curvature; and of its inverse the most
LONG_AGO = 1e6  # [rad] of rolling: what was before a steady state is forgotten
SUMMED = 801  # points about each of two densities: half as many move a mean by 0.001 of its σ
