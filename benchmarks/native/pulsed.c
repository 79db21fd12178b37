/* The scenario of benchmarks/pulses.py with the law "oscillatory": six thrusters that push, by pulses
 * as wide as the command asks for, none below the minimum on-time, and a failure in flight. What a
 * hand can do besides: of the six thrusters it knows that each torque is one of a pair's, so that
 * allocation is a sign, and a period has three holds at most. */
#define PULSED
#include "sampled.c"
