/*
 * springpot_fmu.h: the film of an FMU, for both versions of the standard. fmi2.c and fmi3.c put its functions behind their own.
 * Free for any use: SPDX-License-Identifier: 0BSD
 *
 * Everything that changes is plain data in fmu_state: a copy of it is the state of the FMU.
 */
#ifndef SPRINGPOT_FMU_H
#define SPRINGPOT_FMU_H

#include <stdlib.h>
#include <string.h>

#include "springpot_tick.h"

/* Types of variables. */
enum { FMU_REAL, FMU_WHOLE, FMU_FLAG, FMU_CHOICE };

/* FMU_FILM, FMU_TOKEN, FMU_STEP_S, FMU_LEARNS; variables from FMU_TIME to FMU_VARIABLES, and fmu_types */
#include "springpot_fmu_film.h"

SPRINGPOT_FILM(FMU_FILM);

/* Values of the parameter `mode`. */
enum { FMU_PLANT = 1, FMU_OBSERVER = 2, FMU_FEEDFORWARD = 3, FMU_TRACKING = 4, FMU_ADAPTIVE = 5 };

/* Phases of the life cycle. */
enum { FMU_INSTANTIATED, FMU_INITIALISING, FMU_STEPPING, FMU_TERMINATED };

/* Statuses have these values in both versions. */
enum { FMU_OK = 0, FMU_ERROR = 3 };

/* How a call ended, and why it failed if it did. */
typedef struct {
    int status;
    const char *why;
} fmu_result;

typedef struct {
    char token[sizeof FMU_TOKEN]; /* of this FMU: states of others are refused */
    uint32_t phase;
    uint32_t wholes[FMU_VARIABLES]; /* whole numbers, flags and the mode */
    double reals[FMU_VARIABLES];
    double start; /* s */
    double ticks; /* since then */
    double next;  /* where the next step begins by the importer's clock, s */
    springpot_tick_state law;
} fmu_state;

static fmu_result fmu_ok(void)
{
    const fmu_result result = {FMU_OK, ""};
    return result;
}

static fmu_result fmu_error(const char *why)
{
    fmu_result result = {FMU_ERROR, ""};
    result.why = why;
    return result;
}

/* ---- From instantiation to the first tick. */

/* The state of an FMU that was just instantiated: start values. */
static void fmu_start(fmu_state *state)
{
    /* Bytes between members too: equal states are equal bytes. */
    memset(state, 0, sizeof *state);
    memcpy(state->token, FMU_TOKEN, sizeof FMU_TOKEN);
    state->phase = FMU_INSTANTIATED;
    state->wholes[FMU_MODE] = FMU_PLANT;
    state->reals[FMU_FORCE_SCALE] = 1.0;
    state->reals[FMU_TEMPERATURE] = 20.0;
}

static fmu_result fmu_initialise(fmu_state *state, double start)
{
    if (state->phase != FMU_INSTANTIATED) {
        return fmu_error("initialisation begins once, after instantiation or a reset");
    }
    if (!((start - start) == 0.0)) {
        return fmu_error("the start time must be finite");
    }
    state->start = start;
    state->phase = FMU_INITIALISING;
    return fmu_ok();
}

/* A film at rest, by the parameters. */
static fmu_result fmu_begin(fmu_state *state)
{
    /* By the mode, from 1. */
    static const uint32_t kinds[] = {
        0U, SPRINGPOT_TICK_FILM, SPRINGPOT_TICK_OBSERVER, SPRINGPOT_TICK_FEEDFORWARD, SPRINGPOT_TICK_TRACKING,
        SPRINGPOT_TICK_ADAPTIVE};

    if (state->phase != FMU_INITIALISING) {
        return fmu_error("initialisation has not begun");
    }
    if ((state->wholes[FMU_TEMPERATURE_IS_GIVEN] != 0U) && !springpot_tick_warms(&FMU_FILM, kinds[state->wholes[FMU_MODE]])) {
        return fmu_error((FMU_FILM.temperature == NULL)
                ? "temperature_is_given and this film was not fitted at several temperatures: export one with a [temperature]"
                : "temperature_is_given is for the modes 4 (tracking; feedforward without samples) and 5 (adaptive)");
    }
    if ((state->wholes[FMU_LEARNING] != 0U) && (FMU_LEARNS == 0)) {
        return fmu_error("learning is on and this film has none: export it with harmonics under [board.control]");
    }
    springpot_tick_init(&FMU_FILM, &state->law, kinds[state->wholes[FMU_MODE]], state->wholes[FMU_LEARNING] != 0U);
    state->phase = FMU_STEPPING;
    return fmu_ok();
}

/* ---- Values. */

/* Refuses a call with another number of values than of references. */
static fmu_result fmu_scalars(size_t references, size_t values)
{
    return (references == values) ? fmu_ok() : fmu_error("as many values as references: all are scalars");
}

/* Refuses to read what is not a `variable` of `type`. */
static fmu_result fmu_readable(uint32_t variable, int type)
{
    const bool is_there = (variable < FMU_VARIABLES) && ((int)fmu_types[variable] == type);
    return is_there ? fmu_ok() : fmu_error("no variable of this type has this value reference");
}

/* Refuses to set what cannot be set now. */
static fmu_result fmu_settable(const fmu_state *state, uint32_t variable, int type)
{
    const bool is_parameter = (variable >= FMU_MODE) && (variable < FMU_VOLTAGE);
    const bool is_input = (variable >= FMU_VOLTAGE) && (variable < FMU_DISPLACEMENT);
    fmu_result result = fmu_readable(variable, type);

    if (result.status != FMU_OK) {
        /* refused above */
    } else if (!(is_parameter || is_input)) {
        result = fmu_error("this variable is calculated and cannot be set");
    } else if (is_parameter && (state->phase > FMU_INITIALISING)) {
        result = fmu_error("a parameter can be set until initialisation ends");
    } else {
        /* settable */
    }
    return result;
}

/* The time that was reached (s). */
static double fmu_time(const fmu_state *state)
{
    return state->start + (state->ticks * FMU_STEP_S);
}

static fmu_result fmu_get_real(const fmu_state *state, uint32_t variable, double *value)
{
    const fmu_result result = fmu_readable(variable, FMU_REAL);
    if (result.status == FMU_OK) {
        *value = (variable == FMU_TIME) ? fmu_time(state) : state->reals[variable];
    }
    return result;
}

static fmu_result fmu_set_real(fmu_state *state, uint32_t variable, double value)
{
    fmu_result result = fmu_settable(state, variable, FMU_REAL);
    if ((result.status == FMU_OK) && !((value >= -(double)FLT_MAX) && (value <= (double)FLT_MAX))) {
        result = fmu_error("a value is not finite in single precision");
    }
    if (result.status == FMU_OK) {
        state->reals[variable] = value;
    }
    return result;
}

/* Whole numbers, flags (0 or 1) and the mode. */
static fmu_result fmu_get_whole(const fmu_state *state, uint32_t variable, int type, uint32_t *value)
{
    const fmu_result result = fmu_readable(variable, type);
    if (result.status == FMU_OK) {
        *value = state->wholes[variable];
    }
    return result;
}

static fmu_result fmu_set_whole(fmu_state *state, uint32_t variable, int type, int64_t value)
{
    fmu_result result = fmu_settable(state, variable, type);
    if ((result.status == FMU_OK) && (variable == FMU_MODE) && ((value < FMU_PLANT) || (value > FMU_ADAPTIVE))) {
        result = fmu_error("mode is 1 (plant), 2 (observer), 3 (feedforward), 4 (tracking) or 5 (adaptive)");
    }
    if ((result.status == FMU_OK) && (variable == FMU_SAMPLE_AGE) && ((value < 0) || (value >= (int64_t)SPRINGPOT_PAST))) {
        result = fmu_error("sample_age is 0 to 63 ticks");
    }
    if (result.status == FMU_OK) {
        state->wholes[variable] = (uint32_t)value;
    }
    return result;
}

/* ---- Ticks. */

/* A tick; a sample and a reading of the monitor arrive in the first of a step. */
static void fmu_tick(fmu_state *state, bool is_first)
{
    const float none = SPRINGPOT_NO_READING;
    const bool is_controller = state->wholes[FMU_MODE] >= FMU_FEEDFORWARD;
    springpot_tick_input in;
    springpot_tick_output out;

    in.u = (float)state->reals[is_controller ? FMU_REFERENCE : FMU_VOLTAGE];
    in.sample = (is_first && (state->wholes[FMU_SAMPLE_TAKEN] != 0U)) ? (float)state->reals[FMU_SAMPLE] : none;
    in.age_ticks = state->wholes[FMU_SAMPLE_AGE];
    in.applied = (state->wholes[FMU_APPLIED_IS_GIVEN] != 0U) ? (float)state->reals[FMU_VOLTAGE] : none;
    in.celsius = (state->wholes[FMU_TEMPERATURE_IS_GIVEN] != 0U) ? (float)state->reals[FMU_TEMPERATURE] : none;
    in.reading = (state->wholes[FMU_READING_TAKEN] != 0U) ? (float)state->reals[FMU_READING] : none;
    out = springpot_tick(&FMU_FILM, &state->law, &in);
    if (is_controller) {
        state->reals[FMU_COMMAND] = (double)out.voltage;
        state->reals[FMU_SHAPED_REFERENCE] = (double)out.reference;
    }
    state->reals[FMU_DISPLACEMENT] = (double)out.displacement;
    state->reals[FMU_FORCE] = (double)out.force;
    state->reals[FMU_DISTURBANCE] = (double)out.disturbance;
    state->reals[FMU_FORCE_SCALE] = (double)out.force_scale;
    state->reals[FMU_AGEING] = (double)out.ageing;
    state->reals[FMU_STIFFNESS_CHANGE] = (double)out.stiffness;
    state->wholes[FMU_LIMITS] = out.limited;
    state->wholes[FMU_SENSOR_LOST] = out.is_lost ? 1U : 0U;
}

/* How many ticks a communication step (s) has; 0 for one that is no whole number of them. */
static double fmu_ticks(double step_s)
{
    /* Importers take differences of times: rounding of some 1e-11 of a tick after an hour. */
    const double tolerance = 1e-6;
    const double most = 4294967295.0;
    const double exact = step_s / FMU_STEP_S;
    double ticks = 0.0;

    if ((exact >= (1.0 - tolerance)) && (exact <= most)) {
        const double whole = (double)(uint32_t)(exact + 0.5);
        const double off = exact - whole;
        if ((off <= tolerance) && (off >= -tolerance)) {
            ticks = whole;
        }
    }
    return ticks;
}

/* A communication step of `step_s` from `time_s`: all of it, or nothing where it is refused. */
static fmu_result fmu_step(fmu_state *state, double time_s, double step_s)
{
    const double ticks = fmu_ticks(step_s);
    const double gap = (state->ticks > 0.0) ? ((time_s - state->next) / FMU_STEP_S) : 0.0;
    const bool is_controller = state->wholes[FMU_MODE] >= FMU_FEEDFORWARD;
    float factors[2];
    double tick;

    if (state->phase != FMU_STEPPING) {
        return fmu_error("a step comes after initialisation and before termination");
    }
    if (ticks < 1.0) {
        return fmu_error("a communication step must be a whole multiple of the step size in modelDescription.xml, the tick of the law: "
                         "nothing was done");
    }
    if (is_controller && (ticks > 1.0)) {
        return fmu_error("a controller ticks once in a communication step, because its commands in between would not be applied: "
                         "take steps of the size in modelDescription.xml; nothing was done");
    }
    if (!((gap < 0.5) && (gap > -0.5))) {
        return fmu_error("a step must begin where the last one ended: nothing was done");
    }
    if ((state->wholes[FMU_TEMPERATURE_IS_GIVEN] != 0U)
        && !springpot_temperature_factors(&FMU_FILM, (float)state->reals[FMU_TEMPERATURE], factors)) {
        return fmu_error("the temperature is too far from that of the film's parameters for a law that runs: nothing was done");
    }
    for (tick = 0.0; tick < ticks; tick += 1.0) {
        fmu_tick(state, tick < 1.0);
    }
    state->ticks += ticks;
    state->next = time_s + step_s;
    return fmu_ok();
}

static fmu_result fmu_terminate(fmu_state *state)
{
    fmu_result result = fmu_error("termination comes after initialisation");
    if (state->phase == FMU_STEPPING) {
        state->phase = FMU_TERMINATED;
        result = fmu_ok();
    }
    return result;
}

/* ---- States as copies and as bytes, for the same build of the same FMU. */

/* Copies `state` to `*copy`, which is allocated if it is NULL. */
static fmu_result fmu_copy(const fmu_state *state, void **copy)
{
    if (copy == NULL) {
        return fmu_error("there is no place for the state");
    }
    if (*copy == NULL) {
        *copy = malloc(sizeof *state);
    }
    if (*copy == NULL) {
        return fmu_error("there is no memory for a state");
    }
    memcpy(*copy, state, sizeof *state);
    return fmu_ok();
}

/* Refuses what is no state of this FMU. */
static fmu_result fmu_own(const fmu_state *copy)
{
    const bool is_own = (copy != NULL) && (memcmp(copy->token, FMU_TOKEN, sizeof FMU_TOKEN) == 0);
    return is_own ? fmu_ok() : fmu_error("there is no state, or it is of another FMU");
}

static fmu_result fmu_restore(fmu_state *state, const void *copy)
{
    const fmu_result result = fmu_own((const fmu_state *)copy);
    if (result.status == FMU_OK) {
        memcpy(state, copy, sizeof *state);
    }
    return result;
}

#define FMU_SERIALIZED_BYTES (sizeof(fmu_state) + sizeof(uint64_t))

/* FNV-1a over the bytes of a state: what was cut or changed is refused. */
static uint64_t fmu_checksum(const unsigned char *bytes)
{
    uint64_t sum = UINT64_C(14695981039346656037);
    size_t i;
    for (i = 0U; i < sizeof(fmu_state); i++) {
        sum = (sum ^ (uint64_t)bytes[i]) * UINT64_C(1099511628211);
    }
    return sum;
}

/* The bytes of a state, and their checksum. */
static fmu_result fmu_serialize(const void *copy, unsigned char *bytes, size_t count)
{
    const fmu_result result = fmu_own((const fmu_state *)copy);
    uint64_t sum;
    if (result.status != FMU_OK) {
        return result;
    }
    if ((bytes == NULL) || (count < FMU_SERIALIZED_BYTES)) {
        return fmu_error("there is too little room for a state: ask for its size");
    }
    sum = fmu_checksum((const unsigned char *)copy);
    memcpy(bytes, copy, sizeof(fmu_state));
    memcpy(&bytes[sizeof(fmu_state)], &sum, sizeof sum);
    return result;
}

static fmu_result fmu_deserialize(const unsigned char *bytes, size_t count, void **copy)
{
    fmu_state state;
    uint64_t sum;
    fmu_result result;
    if ((bytes == NULL) || (count != FMU_SERIALIZED_BYTES)) {
        return fmu_error("these bytes are no state of this FMU");
    }
    memcpy(&state, bytes, sizeof state);
    memcpy(&sum, &bytes[sizeof state], sizeof sum);
    result = fmu_own(&state);
    if ((result.status == FMU_OK) && (sum != fmu_checksum(bytes))) {
        result = fmu_error("this state was changed: its checksum is wrong");
    }
    return (result.status == FMU_OK) ? fmu_copy(&state, copy) : result;
}

#endif /* SPRINGPOT_FMU_H */
