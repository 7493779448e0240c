/*
 * springpot_tick.h: one tick of a film or of a law of control, chosen by a number. NAME_mex.c and NAME_sfun.c step by it.
 *
 * SPDX-License-Identifier: 0BSD
 *
 * It adds no arithmetic to springpot.h: it calls its functions in the order of the controller, and keeps the voltage that was commanded
 * last. The states are the caller's.
 */
#ifndef SPRINGPOT_TICK_H
#define SPRINGPOT_TICK_H

#include <string.h>

#include "springpot.h"

/* What is stepped, and what `u` is. */
#define SPRINGPOT_TICK_DISPLACEMENT 1U /* the law, creep: u is the force on the film, weight included, N */
#define SPRINGPOT_TICK_FORCE 2U        /* the law, relaxation: u is the displacement, m */
#define SPRINGPOT_TICK_FILM 3U         /* the film under a voltage: u is the voltage, V */
#define SPRINGPOT_TICK_FEEDFORWARD 4U  /* u is the reference, m */
#define SPRINGPOT_TICK_OBSERVER 5U     /* u is the voltage on the film since the last tick, V */
#define SPRINGPOT_TICK_TRACKING 6U     /* u is the reference, m; learns cycles where the film's file says so */
#define SPRINGPOT_TICK_KINDS 6U

/* NaN where there is none. */
typedef struct {
    float u;
    float sample;       /* of the displacement sensor, m */
    uint32_t age_ticks; /* how many ticks ago it was measured, 0 to SPRINGPOT_PAST - 1 */
    float applied;      /* voltage that was really applied since the last tick, V; NaN: as it was commanded */
    float reading;      /* of a voltage monitor at the end of that time, V */
} springpot_tick_input;

/* NaN where there is none. */
typedef struct {
    float displacement; /* of the film; of observer and tracking the estimate, m */
    float voltage;      /* the command, or what acts on the film, V */
    float force;        /* on the film, weight included; of feedforward and tracking the electrostatic force that they need, N */
    float reference;    /* shaped, m */
    float disturbance;  /* force that the model does not know, N */
    float force_scale;  /* effect of the electrostatic force over the model's */
    uint32_t limited;   /* SPRINGPOT_BELOW_ZERO and its siblings */
} springpot_tick_output;

typedef struct {
    uint32_t kind;
    float commanded;  /* V */
    uint32_t is_free; /* 1: the last command met no limit */
    union {
        springpot_state law;
        springpot_feedforward_state feedforward;
        springpot_observer_state observer;
        struct {
            springpot_tracking_state tracking;
            springpot_learning_state learning;
        } follows;
    } of;
} springpot_tick_state;

/* States are stored and compared as words: nothing is padded. */
SPRINGPOT_ASSERT(sizeof(springpot_tick_state) == 2132U, a_state_of_a_tick_takes_2132_bytes);

/* Sets all of `state` to a film at rest at x = 0 and 0 V. `kind` is one of SPRINGPOT_TICK_DISPLACEMENT and its siblings. */
static inline void springpot_tick_init(const springpot_film *film, springpot_tick_state *state, uint32_t kind)
{
    /* What the mode does not use as well: states are kept as bytes. */
    (void)memset(state, 0, sizeof *state);
    state->kind = kind;
    state->is_free = 1U;
    if (kind == SPRINGPOT_TICK_FEEDFORWARD) {
        springpot_feedforward_init(film, &state->of.feedforward);
    } else if (kind == SPRINGPOT_TICK_OBSERVER) {
        springpot_observer_init(film, &state->of.observer);
    } else if (kind == SPRINGPOT_TICK_TRACKING) {
        springpot_tracking_init(film, &state->of.follows.tracking);
        springpot_learning_init(film, &state->of.follows.learning, 0.0F);
    } else {
        springpot_init(film, &state->of.law);
    }
}

/* A tick of tracking: what was applied, the sample, the command. */
static inline void springpot_tick_tracking(
    const springpot_film *film, springpot_tick_state *state, const springpot_tick_input *in, springpot_tick_output *out)
{
    springpot_tracking_state *tracking = &state->of.follows.tracking;
    springpot_learning_state *learning = &state->of.follows.learning;
    const float applied = springpot_is_finite(in->applied) ? in->applied : state->commanded;
    springpot_sample sample;
    const springpot_sample *arrived;
    springpot_command command;
    float reference;

    sample.displacement = in->sample;
    sample.age_ticks = in->age_ticks;
    arrived = springpot_is_finite(in->sample) ? &sample : NULL;
    out->displacement = springpot_tracking_observe(film, tracking, applied, in->reading, arrived);
    reference = springpot_learning_advance(film, learning, in->u, arrived, state->is_free != 0U);
    if (film->learning != NULL) {
        springpot_tracking_leave_cycles(tracking, learning->has_learned != 0U);
    }
    command = springpot_tracking_command(film, tracking, reference);
    state->commanded = command.voltage;
    state->is_free = (command.limited == 0U) ? 1U : 0U;
    out->voltage = command.voltage;
    out->force = command.force;
    out->reference = command.reference;
    out->disturbance = tracking->observer.disturbance;
    out->force_scale = tracking->observer.force_scale;
    out->limited = command.limited;
}

/* A tick of `state->kind`. A `u` that is no number stays in the film for good: refuse it before, or, of a reference, let the last stay. */
static inline springpot_tick_output springpot_tick(
    const springpot_film *film, springpot_tick_state *state, const springpot_tick_input *in)
{
    const float none = SPRINGPOT_NO_READING;
    springpot_tick_output out = {0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0U};

    out.voltage = none;
    out.reference = none;
    out.force = none;
    if (state->kind == SPRINGPOT_TICK_DISPLACEMENT) {
        out.force = in->u;
        out.displacement = springpot_displacement(film, &state->of.law, in->u);
        out.limited = springpot_beyond_curve(&state->of.law) ? SPRINGPOT_BEYOND_CURVE : 0U;
    } else if (state->kind == SPRINGPOT_TICK_FORCE) {
        out.displacement = in->u;
        out.force = springpot_force(film, &state->of.law, in->u);
        out.limited = springpot_beyond_curve(&state->of.law) ? SPRINGPOT_BEYOND_CURVE : 0U;
    } else if (state->kind == SPRINGPOT_TICK_FEEDFORWARD) {
        springpot_feedforward_state *feedforward = &state->of.feedforward;
        const float applied = springpot_is_finite(in->applied) ? in->applied : state->commanded;
        springpot_command command;
        out.displacement = springpot_feedforward_apply(film, feedforward, applied, in->reading);
        command = springpot_feedforward_command(film, feedforward, in->u);
        state->commanded = command.voltage;
        out.voltage = command.voltage;
        out.force = command.force;
        out.reference = command.reference;
        out.limited = command.limited;
    } else if (state->kind == SPRINGPOT_TICK_OBSERVER) {
        springpot_observer_state *observer = &state->of.observer;
        springpot_sample sample;
        sample.displacement = in->sample;
        sample.age_ticks = in->age_ticks;
        out.displacement =
            springpot_observer_observe(film, observer, in->u, springpot_is_finite(in->sample) ? &sample : NULL);
        out.voltage = in->u;
        out.disturbance = observer->disturbance;
        out.force_scale = observer->force_scale;
        out.limited = springpot_beyond_curve(&observer->film) ? SPRINGPOT_BEYOND_CURVE : 0U;
    } else if (state->kind == SPRINGPOT_TICK_TRACKING) {
        springpot_tick_tracking(film, state, in, &out);
    } else {
        const springpot_load load = springpot_load_of(&film->drive, in->u);
        out.displacement = springpot_displacement_under(film, &state->of.law, load);
        out.voltage = in->u;
        out.force = load.force + (load.slope * out.displacement);
        out.limited = springpot_beyond_curve(&state->of.law) ? SPRINGPOT_BEYOND_CURVE : 0U;
    }
    return out;
}

#endif /* SPRINGPOT_TICK_H */
