/*
 * The film @SYMBOL@ as a function for MATLAB and Octave, by springpot @VERSION@.
 *
 * SPDX-License-Identifier: 0BSD
 *
 * BUILD, in this folder:
 *
 *   MATLAB   mex @NAME@_mex.c @NAME@.c
 *   Octave   mkoctfile --mex @NAME@_mex.c @NAME@.c
 *
 * CALL. Each element of the input is a tick of step_s seconds. Numbers are real, double or single; they are computed in single precision.
 *
 *   info         = @NAME@_mex()                        numbers of the film: step_s, max_voltage_v and others
 *   out          = @NAME@_mex(mode, in)                from a film at rest
 *   [out, state] = @NAME@_mex(mode, in, state)         goes on where `state` was returned
 *
 *   mode            in                                 fields of `in` beside it, if it is a structure
 *   'displacement'  force_n, weight included
 *   'force'         displacement_m
 *   'film'          voltage_v
 *   'feedforward'   reference_m                        applied_v, reading_v
 *   'observer'      voltage_v                          sample_m, age_ticks
 *   'tracking'      reference_m                        sample_m, age_ticks, applied_v, reading_v, temperature_c
 *   'adaptive'      the same: the law follows a film that changes
 *
 * A voltage above max_voltage_v acts as max_voltage_v, and `limited` has the bit 2.
 *
 * `in` is an array, or a structure whose first field is the one of the second column. The others are arrays of as many elements, or of
 * one for all ticks; NaN, or the field left out, is: no sample, no reading, applied as it was commanded, and the temperature as before.
 * temperature_c, of a film that was fitted at several: what it is at from now on; without samples tracking is feedforward. age_ticks: how old a
 * sample is, 0 to 63, 0 if left out. `out` is a structure of columns, one row a tick: displacement_m, voltage_v, force_n, reference_m,
 * disturbance_n, force_scale, limited, ageing and stiffness_change (of what adaptive has learned), NaN where a mode has none. `state` is a column of uint8; it belongs to film and mode.
 *
 * It is not a safety system: see springpot.h.
 */
#include <string.h>

#include "mex.h"

#include "springpot_tick.h"

SPRINGPOT_FILM(@SYMBOL@);

#define FIELDS 6U /* of the input */

/* A field of the input. */
typedef struct {
    const char *name;
    const void *data; /* NULL: left out */
    size_t count;
    bool is_single;
} column;

/* A mode: its name, and the fields that it takes. */
typedef struct {
    const char *name;
    uint32_t kind;
    const char *fields[FIELDS]; /* u, sample, age, applied, reading, temperature */
} mode;

static const mode modes[SPRINGPOT_TICK_KINDS] = {
    {"displacement", SPRINGPOT_TICK_DISPLACEMENT, {"force_n"}},
    {"force", SPRINGPOT_TICK_FORCE, {"displacement_m"}},
    {"film", SPRINGPOT_TICK_FILM, {"voltage_v"}},
    {"feedforward", SPRINGPOT_TICK_FEEDFORWARD, {"reference_m", NULL, NULL, "applied_v", "reading_v"}},
    {"observer", SPRINGPOT_TICK_OBSERVER, {"voltage_v", "sample_m", "age_ticks"}},
    {"tracking", SPRINGPOT_TICK_TRACKING, {"reference_m", "sample_m", "age_ticks", "applied_v", "reading_v", "temperature_c"}},
    {"adaptive", SPRINGPOT_TICK_ADAPTIVE, {"reference_m", "sample_m", "age_ticks", "applied_v", "reading_v", "temperature_c"}},
};

/* A state as the caller keeps it: refused by another film, another mode or another version. */
typedef struct {
    uint32_t mark;
    uint32_t film;
    springpot_tick_state state;
} kept;

#define MARK (0x53503000U + SPRINGPOT_FORMAT)
#define REFUSED "springpot:input"

/* A fingerprint of the film (FNV-1a). */
static uint32_t mixed(uint32_t hash, const void *from, size_t bytes)
{
    const unsigned char *data = (const unsigned char *)from;
    size_t i;
    for (i = 0U; i < bytes; i++) {
        hash = (hash ^ data[i]) * 16777619U;
    }
    return hash;
}

static uint32_t fingerprint(const springpot_film *film)
{
    uint32_t hash = mixed(2166136261U, &film->step_s, sizeof film->step_s);
    hash = mixed(hash, &film->drive, sizeof film->drive);
    hash = mixed(hash, &film->inverse, sizeof film->inverse);
    hash = mixed(hash, &film->observer, sizeof film->observer);
    if (film->curve != NULL) {
        hash = mixed(hash, film->curve, sizeof *film->curve);
    }
    if (film->spring != NULL) {
        hash = mixed(hash, film->spring, sizeof *film->spring);
    }
    if (film->series != NULL) {
        hash = mixed(hash, film->series, sizeof *film->series);
    }
    hash = mixed(hash, &film->fade, sizeof film->fade);
    hash = mixed(hash, &film->adaptation, sizeof film->adaptation);
    if (film->amplifier != NULL) {
        hash = mixed(hash, film->amplifier, sizeof *film->amplifier);
    }
    if (film->learning != NULL) {
        hash = mixed(hash, film->learning, sizeof *film->learning);
    }
    if (film->temperature != NULL) {
        hash = mixed(hash, film->temperature, sizeof *film->temperature);
    }
    return mixed(hash, &film->law, sizeof film->law);
}

/* Numbers of the film, by which a caller recognises the film. */
static mxArray *info(const springpot_film *film)
{
    static const char *names[] = {"film", "step_s", "max_voltage_v", "force_per_square_volt", "stretch_coupling",
        "saturation_per_square_volt", "preload_n", "stiffness_n_per_m", "has_curve", "learns", "temperature_c", "state_bytes"};
    mxArray *answer = mxCreateStructMatrix(1, 1, (int)(sizeof names / sizeof names[0]), names);
    mxSetField(answer, 0, "film", mxCreateString("@SYMBOL@"));
    mxSetField(answer, 0, "step_s", mxCreateDoubleScalar((double)film->step_s));
    mxSetField(answer, 0, "max_voltage_v", mxCreateDoubleScalar((double)film->inverse.max_voltage));
    mxSetField(answer, 0, "force_per_square_volt", mxCreateDoubleScalar((double)film->drive.force_per_square_volt));
    mxSetField(answer, 0, "stretch_coupling", mxCreateDoubleScalar((double)film->drive.coupling));
    mxSetField(answer, 0, "saturation_per_square_volt", mxCreateDoubleScalar((double)film->drive.saturation));
    mxSetField(answer, 0, "preload_n", mxCreateDoubleScalar((double)film->drive.preload));
    mxSetField(answer, 0, "stiffness_n_per_m", mxCreateDoubleScalar((double)film->law.stiffness));
    mxSetField(answer, 0, "has_curve", mxCreateLogicalScalar(film->curve != NULL));
    mxSetField(answer, 0, "learns", mxCreateLogicalScalar(film->learning != NULL));
    mxSetField(answer, 0, "temperature_c",
        mxCreateDoubleScalar((film->temperature != NULL) ? (double)film->temperature->reference : (double)SPRINGPOT_NO_READING));
    mxSetField(answer, 0, "state_bytes", mxCreateDoubleScalar((double)sizeof(kept)));
    return answer;
}

static const mode *mode_of(const mxArray *argument)
{
    char name[16];
    size_t i;
    if (!mxIsChar(argument) || (mxGetString(argument, name, sizeof name) != 0)) {
        name[0] = '\0';
    }
    for (i = 0U; i < SPRINGPOT_TICK_KINDS; i++) {
        if (strcmp(name, modes[i].name) == 0) {
            return &modes[i];
        }
    }
    mexErrMsgIdAndTxt(REFUSED, "mode: it is 'displacement', 'force', 'film', 'feedforward', 'observer', 'tracking' or 'adaptive'");
    return NULL;
}

/* Reads `array` into a field; `ticks` is the number of ticks, or SIZE_MAX for the field that says it. */
static void take(column *to, const char *name, const mxArray *array, size_t ticks)
{
    const bool is_single = mxIsSingle(array);
    if (!(is_single || mxIsDouble(array)) || mxIsComplex(array) || mxIsSparse(array)) {
        mexErrMsgIdAndTxt(REFUSED, "%s: it must be a real and full array of double or single", name);
    }
    if (mxGetNumberOfDimensions(array) != 2 || ((mxGetM(array) > 1) && (mxGetN(array) > 1))) {
        mexErrMsgIdAndTxt(REFUSED, "%s: it must be one row or one column", name);
    }
    to->name = name;
    to->count = mxGetNumberOfElements(array);
    to->is_single = is_single;
    to->data = mxGetData(array);
    if ((ticks != SIZE_MAX) && (to->count != ticks) && (to->count != 1U)) {
        mexErrMsgIdAndTxt(REFUSED, "%s: it has %.0f elements; it needs one, or %.0f as there are ticks", name,
            (double)to->count, (double)ticks);
    }
}

/* Reads the structure or array `in` for a mode. Returns the number of ticks. */
static size_t take_all(column *columns, const mode *of, const mxArray *in)
{
    size_t i;
    size_t ticks;
    int k;
    if (!mxIsStruct(in)) {
        take(&columns[0], of->fields[0], in, SIZE_MAX);
        return columns[0].count;
    }
    if (mxGetNumberOfElements(in) != 1U) {
        mexErrMsgIdAndTxt(REFUSED, "in: it must be one structure, not an array of structures");
    }
    for (k = 0; k < mxGetNumberOfFields(in); k++) {
        const char *name = mxGetFieldNameByNumber(in, k);
        bool is_known = false;
        for (i = 0U; i < FIELDS; i++) {
            is_known = is_known || ((of->fields[i] != NULL) && (strcmp(name, of->fields[i]) == 0));
        }
        if (!is_known) {
            mexErrMsgIdAndTxt(REFUSED, "%s: mode '%s' has no such field; the head of @NAME@_mex.c lists them", name, of->name);
        }
    }
    if (mxGetField(in, 0, of->fields[0]) == NULL) {
        mexErrMsgIdAndTxt(REFUSED, "%s: mode '%s' needs this field", of->fields[0], of->name);
    }
    take(&columns[0], of->fields[0], mxGetField(in, 0, of->fields[0]), SIZE_MAX);
    ticks = columns[0].count;
    for (i = 1U; i < FIELDS; i++) {
        const mxArray *field = (of->fields[i] == NULL) ? NULL : mxGetField(in, 0, of->fields[i]);
        if (field != NULL) {
            take(&columns[i], of->fields[i], field, ticks);
        }
    }
    return ticks;
}

/* Element `k` in single precision; `otherwise` for a field that was left out. */
static float value_at(const column *from, size_t k, float otherwise)
{
    const size_t at = (from->count == 1U) ? 0U : k;
    float value = otherwise;
    if (from->data != NULL) {
        value = from->is_single ? ((const float *)from->data)[at] : (float)((const double *)from->data)[at];
    }
    return value;
}

/* A tick's input. What the laws would keep for good is refused: all is read before the first step. */
static springpot_tick_input input_at(const column *columns, const mode *of, size_t k)
{
    const bool is_reference = springpot_tick_controls(of->kind);
    const float none = SPRINGPOT_NO_READING;
    springpot_tick_input in;
    float factors[2];
    float age;
    size_t i;
    in.u = value_at(&columns[0], k, 0.0F);
    in.sample = value_at(&columns[1], k, none);
    age = value_at(&columns[2], k, 0.0F);
    in.applied = value_at(&columns[3], k, none);
    in.reading = value_at(&columns[4], k, none);
    in.celsius = value_at(&columns[5], k, none);
    if (!is_reference && !springpot_is_finite(in.u)) {
        mexErrMsgIdAndTxt(REFUSED, "%s(%.0f): it is not finite in single precision", columns[0].name, (double)k + 1.0);
    }
    for (i = 0U; i < FIELDS; i++) {
        const float value = value_at(&columns[i], k, 0.0F);
        if ((value - value != 0.0F) && (value == value)) {
            mexErrMsgIdAndTxt(REFUSED, "%s(%.0f): it is infinite in single precision", columns[i].name, (double)k + 1.0);
        }
    }
    if (!((age >= 0.0F) && (age < (float)SPRINGPOT_PAST))) {
        mexErrMsgIdAndTxt(REFUSED, "age_ticks(%.0f): it must be 0 to %u", (double)k + 1.0, (unsigned)(SPRINGPOT_PAST - 1U));
    }
    if ((in.celsius == in.celsius) && !springpot_temperature_factors(&@SYMBOL@, in.celsius, factors)) {
        mexErrMsgIdAndTxt(REFUSED, "temperature_c(%.0f): %s", (double)k + 1.0,
            springpot_tick_warms(&@SYMBOL@, of->kind) ? "too far from that of the film's parameters for a law that runs"
                                                     : "the film was not fitted at several temperatures");
    }
    in.age_ticks = (uint32_t)age;
    if ((float)in.age_ticks != age) {
        mexErrMsgIdAndTxt(REFUSED, "age_ticks(%.0f): it must be a whole number of ticks", (double)k + 1.0);
    }
    return in;
}

static void take_state(kept *to, const mode *of, const mxArray *array)
{
    if (!mxIsUint8(array) || (mxGetNumberOfElements(array) != sizeof *to)) {
        mexErrMsgIdAndTxt(REFUSED, "state: it must be what @NAME@_mex returned, uint8 of %u elements", (unsigned)sizeof *to);
    }
    memcpy(to, mxGetData(array), sizeof *to);
    if ((to->mark != MARK) || (to->film != fingerprint(&@SYMBOL@))) {
        mexErrMsgIdAndTxt(REFUSED, "state: it is of another film");
    }
    if (to->state.kind != of->kind) {
        mexErrMsgIdAndTxt(REFUSED, "state: it is of another mode than '%s'", of->name);
    }
}

void mexFunction(int nlhs, mxArray *plhs[], int nrhs, const mxArray *prhs[])
{
    static const char *names[] = {
        "displacement_m", "voltage_v", "force_n", "reference_m", "disturbance_n", "force_scale", "limited", "ageing", "stiffness_change"};
    column columns[FIELDS] = {{NULL, NULL, 0U, false}};
    double *rows[sizeof names / sizeof names[0]];
    const mode *of;
    kept now;
    size_t ticks;
    size_t k;

    if ((nrhs == 0) && (nlhs <= 1)) {
        plhs[0] = info(&@SYMBOL@);
        return;
    }
    if ((nrhs < 2) || (nrhs > 3) || (nlhs > 2)) {
        mexErrMsgIdAndTxt(REFUSED, "call it as [out, state] = @NAME@_mex(mode, in) or @NAME@_mex(mode, in, state)");
    }
    of = mode_of(prhs[0]);
    ticks = take_all(columns, of, prhs[1]);
    if (nrhs == 3) {
        take_state(&now, of, prhs[2]);
    } else {
        now.mark = MARK;
        now.film = fingerprint(&@SYMBOL@);
        springpot_tick_init(&@SYMBOL@, &now.state, of->kind, of->kind >= SPRINGPOT_TICK_TRACKING);
    }
    for (k = 0U; k < ticks; k++) {
        (void)input_at(columns, of, k);
    }
    plhs[0] = mxCreateStructMatrix(1, 1, (int)(sizeof names / sizeof names[0]), names);
    for (k = 0U; k < (sizeof names / sizeof names[0]); k++) {
        mxArray *rows_of = mxCreateDoubleMatrix(ticks, 1, mxREAL);
        rows[k] = (double *)mxGetData(rows_of);
        mxSetField(plhs[0], 0, names[k], rows_of);
    }
    for (k = 0U; k < ticks; k++) {
        const springpot_tick_input in = input_at(columns, of, k);
        const springpot_tick_output out = springpot_tick(&@SYMBOL@, &now.state, &in);
        rows[0][k] = (double)out.displacement;
        rows[1][k] = (double)out.voltage;
        rows[2][k] = (double)out.force;
        rows[3][k] = (double)out.reference;
        rows[4][k] = (double)out.disturbance;
        rows[5][k] = (double)out.force_scale;
        rows[6][k] = (double)out.limited;
        rows[7][k] = (double)out.ageing;
        rows[8][k] = (double)out.stiffness;
    }
    if (nlhs == 2) {
        plhs[1] = mxCreateNumericMatrix(sizeof now, 1, mxUINT8_CLASS, mxREAL);
        memcpy(mxGetData(plhs[1]), &now, sizeof now);
    }
}
