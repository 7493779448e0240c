/*
 * The film @SYMBOL@ as a block for Simulink: a Level-2 S-function, by springpot @VERSION@.
 *
 * SPDX-License-Identifier: 0BSD
 *
 * BUILD in MATLAB, in this folder: mex @NAME@_sfun.c @NAME@.c
 * USE: an S-Function block named @NAME@_sfun with two parameters: mode, age of samples. For example 6, 0.
 *
 *   mode            inputs, in this order                  the voltage that comes out
 *   1 displacement  force on the film (N)                  NaN
 *   2 force         displacement (m)                       NaN
 *   3 film          voltage (V), as it acts up to the      the voltage
 *                   film's largest voltage
 *   4 feedforward   reference (m), applied voltage (V)     the command
 *   5 observer      voltage (V), sample (m)                the voltage
 *   6 tracking      reference (m), sample (m), applied (V) the command
 *   7 adaptive      the same: the law follows a film that changes
 *   6 and 7 of a film that was fitted at several temperatures: a fourth input, its temperature (degrees C)
 *
 * Outputs in every mode: displacement (m; of 5 to 7 the estimate), voltage (V), force (N), and the limits that were met, as a sum of the
 * bits that springpot.h names. All are scalars of double, computed in single precision.
 *
 * sample: NaN in a tick without one. age (ticks, 0 to 63): how old samples are when they arrive; without effect in other modes.
 * applied: the voltage that was really applied since the last tick, after every limit behind the block; NaN: as it was commanded. A
 * ground is a sample of 0 m, 0 V applied, or 0 degrees C: without a sensor connect a constant NaN. temperature: NaN: as before, that of the film's
 * parameters at first; without samples mode 6 is feedforward.
 *
 * The sample time is step_s of the film, which is the only rate at which the law is right. mdlOutputs steps a copy of the state
 * and mdlUpdate keeps it, so that outputs may be asked for several times in a step. Inputs reach outputs in the same tick (direct
 * feedthrough). Both states are DWork vectors: a model may hold several such blocks.
 *
 * It is not a safety system: see springpot.h.
 */
#define S_FUNCTION_NAME @NAME@_sfun
#define S_FUNCTION_LEVEL 2

#include <string.h>

#include "simstruc.h"

#include "springpot_tick.h"

SPRINGPOT_FILM(@SYMBOL@);

/* Dialog parameters. */
#define MODE 0
#define AGE 1
#define PARAMETERS 2
/* Inputs beside the first, by mode. */
#define NO_PORT (-1)
/* DWork vectors: as it is at the last tick, and at the next one. */
#define KEPT 0
#define NEXT 1
#define WORDS (sizeof(springpot_tick_state) / sizeof(uint32_t))
#define OUTPUTS 4

/* Numbers of the ports of sample, applied voltage and temperature, and how many inputs there are. */
typedef struct {
    int_T sample;
    int_T applied;
    int_T celsius;
    int_T count;
} ports;

static ports ports_of(uint32_t mode)
{
    static const ports all[SPRINGPOT_TICK_KINDS] = {{NO_PORT, NO_PORT, NO_PORT, 1}, {NO_PORT, NO_PORT, NO_PORT, 1},
        {NO_PORT, NO_PORT, NO_PORT, 1}, {NO_PORT, 1, NO_PORT, 2}, {1, NO_PORT, NO_PORT, 2}, {1, 2, NO_PORT, 3}, {1, 2, NO_PORT, 3}};
    ports of = all[mode - 1U];
    if (springpot_tick_warms(&@SYMBOL@, mode)) {
        of.celsius = of.count;
        of.count++;
    }
    return of;
}

/* A whole number from `low` to `high` in a dialog parameter, or -1. */
static int_T whole(SimStruct *S, int_T parameter, int_T low, int_T high)
{
    const mxArray *given = ssGetSFcnParam(S, parameter);
    int_T answer = -1;
    if (mxIsDouble(given) && !mxIsComplex(given) && (mxGetNumberOfElements(given) == 1)) {
        const real_T value = mxGetScalar(given);
        if ((value >= (real_T)low) && (value <= (real_T)high) && ((real_T)(int_T)value == value)) {
            answer = (int_T)value;
        }
    }
    return answer;
}

/* The mode that the dialog gives, which mdlCheckParameters has seen. */
static uint32_t mode_of(SimStruct *S)
{
    return (uint32_t)whole(S, MODE, 1, (int_T)SPRINGPOT_TICK_KINDS);
}

#define MDL_CHECK_PARAMETERS
static void mdlCheckParameters(SimStruct *S)
{
    if (whole(S, MODE, 1, (int_T)SPRINGPOT_TICK_KINDS) < 0) {
        ssSetErrorStatus(S, "@NAME@_sfun: the mode, the first parameter, must be a whole number from 1 to 7");
    } else if (whole(S, AGE, 0, (int_T)SPRINGPOT_PAST - 1) < 0) {
        ssSetErrorStatus(S, "@NAME@_sfun: the age of samples, the second parameter, must be a whole number from 0 to 63");
    } else {
        /* good */
    }
}

static void mdlInitializeSizes(SimStruct *S)
{
    int_T k;
    int_T inputs;

    ssSetNumSFcnParams(S, PARAMETERS);
    if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) {
        return; /* Simulink reports it */
    }
    mdlCheckParameters(S);
    if (ssGetErrorStatus(S) != NULL) {
        return;
    }
    for (k = 0; k < PARAMETERS; k++) {
        ssSetSFcnParamTunable(S, k, SS_PRM_NOT_TUNABLE);
    }
    ssSetNumContStates(S, 0);
    ssSetNumDiscStates(S, 0);
    inputs = ports_of(mode_of(S)).count;
    if (!ssSetNumInputPorts(S, inputs)) {
        return;
    }
    for (k = 0; k < inputs; k++) {
        ssSetInputPortWidth(S, k, 1);
        ssSetInputPortDataType(S, k, SS_DOUBLE);
        ssSetInputPortRequiredContiguous(S, k, 1);
        ssSetInputPortDirectFeedThrough(S, k, 1);
    }
    if (!ssSetNumOutputPorts(S, OUTPUTS)) {
        return;
    }
    for (k = 0; k < OUTPUTS; k++) {
        ssSetOutputPortWidth(S, k, 1);
        ssSetOutputPortDataType(S, k, SS_DOUBLE);
    }
    if (!ssSetNumDWork(S, 2)) {
        return;
    }
    for (k = KEPT; k <= NEXT; k++) {
        ssSetDWorkWidth(S, k, (int_T)WORDS);
        ssSetDWorkDataType(S, k, SS_UINT32);
    }
    ssSetDWorkName(S, KEPT, "kept");
    ssSetDWorkName(S, NEXT, "next");
    ssSetNumSampleTimes(S, 1);
    /* States saved with the simulation are the DWork vectors; the macro's name depends on the release. */
#if defined(ssSetOperatingPointCompliance)
    ssSetOperatingPointCompliance(S, USE_DEFAULT_OPERATING_POINT);
#elif defined(ssSetSimStateCompliance)
    ssSetSimStateCompliance(S, USE_DEFAULT_SIM_STATE);
#endif
    ssSetOptions(S, SS_OPTION_EXCEPTION_FREE_CODE);
}

/* step_s is single precision of the step that was asked for: 0.001 s, not 0.001000000047 s, for other blocks to have the same rate. */
static real_T step_s(void)
{
    const real_T step = (real_T)@SYMBOL@.step_s;
    const real_T rate = 1.0 / step;
    const real_T whole_rate = floor(rate + 0.5);
    return ((rate - whole_rate < 1e-6 * rate) && (whole_rate - rate < 1e-6 * rate)) ? (1.0 / whole_rate) : step;
}

static void mdlInitializeSampleTimes(SimStruct *S)
{
    ssSetSampleTime(S, 0, step_s());
    ssSetOffsetTime(S, 0, 0.0);
}

/* At the start, and where an enabled subsystem resets its states: a film at rest. */
#define MDL_INITIALIZE_CONDITIONS
static void mdlInitializeConditions(SimStruct *S)
{
    springpot_tick_state state;
    springpot_tick_init(&@SYMBOL@, &state, mode_of(S), mode_of(S) >= SPRINGPOT_TICK_TRACKING);
    memcpy(ssGetDWork(S, KEPT), &state, sizeof state);
    memcpy(ssGetDWork(S, NEXT), &state, sizeof state);
}

static float input_at(SimStruct *S, int_T port)
{
    return (port == NO_PORT) ? SPRINGPOT_NO_READING : (float)*(const real_T *)ssGetInputPortSignal(S, port);
}

static void mdlOutputs(SimStruct *S, int_T tid)
{
    const ports has = ports_of(mode_of(S));
    float factors[2];
    springpot_tick_state state;
    springpot_tick_input in;
    springpot_tick_output out;
    int_T k;

    (void)tid;
    memcpy(&state, ssGetDWork(S, KEPT), sizeof state);
    for (k = 0; k < has.count; k++) {
        const float value = input_at(S, k);
        /* NaN is missing; a reference that is missing leaves the last one in force. A film would keep it for good. */
        const bool may_miss = (k > 0) || springpot_tick_controls(state.kind);
        if (!springpot_is_finite(value) && !(may_miss && (value != value))) {
            ssSetErrorStatus(S, (k == 0) ? "@NAME@_sfun: the first input is not finite in single precision"
                                         : "@NAME@_sfun: a sample, an applied voltage or a temperature is infinite in single precision");
            return;
        }
    }
    in.u = input_at(S, 0);
    in.sample = input_at(S, has.sample);
    in.age_ticks = (uint32_t)whole(S, AGE, 0, (int_T)SPRINGPOT_PAST - 1);
    in.applied = input_at(S, has.applied);
    in.reading = SPRINGPOT_NO_READING;
    in.celsius = input_at(S, has.celsius);
    if ((in.celsius == in.celsius) && !springpot_temperature_factors(&@SYMBOL@, in.celsius, factors)) {
        ssSetErrorStatus(S, "@NAME@_sfun: the temperature is too far from that of the film's parameters for a law that runs");
        return;
    }
    out = springpot_tick(&@SYMBOL@, &state, &in);
    memcpy(ssGetDWork(S, NEXT), &state, sizeof state);
    *(real_T *)ssGetOutputPortSignal(S, 0) = (real_T)out.displacement;
    *(real_T *)ssGetOutputPortSignal(S, 1) = (real_T)out.voltage;
    *(real_T *)ssGetOutputPortSignal(S, 2) = (real_T)out.force;
    *(real_T *)ssGetOutputPortSignal(S, 3) = (real_T)out.limited;
}

#define MDL_UPDATE
static void mdlUpdate(SimStruct *S, int_T tid)
{
    (void)tid;
    memcpy(ssGetDWork(S, KEPT), ssGetDWork(S, NEXT), sizeof(springpot_tick_state));
}

static void mdlTerminate(SimStruct *S)
{
    (void)S;
}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
