/*
 * springpot_tick.h: one tick of a film or of a law of control, chosen by a number: for MATLAB, Simulink and FMUs.
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

/* Modes, and the meaning of `u` in each. */
#define SPRINGPOT_TICK_DISPLACEMENT 1U /* the law, creep: u is the force on the film, weight included, N */
#define SPRINGPOT_TICK_FORCE 2U        /* the law, relaxation: u is the displacement, m */
#define SPRINGPOT_TICK_FILM 3U         /* the film under a voltage: u is the voltage, V */
#define SPRINGPOT_TICK_FEEDFORWARD 4U  /* u is the reference, m */
#define SPRINGPOT_TICK_OBSERVER 5U     /* u is the voltage on the film since the last tick, V */
#define SPRINGPOT_TICK_TRACKING 6U     /* u is the reference, m */
#define SPRINGPOT_TICK_ADAPTIVE 7U     /* the same, of a film that changes: the law follows it */
#define SPRINGPOT_TICK_KINDS 7U

/* Inputs of a tick; NaN: missing. */
typedef struct {
    float u;
    float sample;       /* of the displacement sensor, m */
    uint32_t age_ticks; /* how many ticks ago it was measured, 0 to SPRINGPOT_PAST - 1 */
    float applied;      /* voltage that was really applied since the last tick, V; NaN: as it was commanded */
    float reading;      /* of a voltage monitor at the end of that time, V */
    float celsius;      /* temperature of the film from now on, degrees C, where springpot_tick_warms; NaN: as before */
} springpot_tick_input;

/* Outputs of a tick; NaN: a mode does not have it. */
typedef struct {
    float displacement; /* of the film; of observer and tracking the estimate, m */
    float voltage;      /* the command, or what acts on the film, V */
    float force;        /* on the film, weight included; of feedforward and tracking the electrostatic force that they need, N */
    float reference;    /* shaped, m */
    float disturbance;  /* force that the model does not know, N */
    float force_scale;  /* effect of the electrostatic force over the model's */
    float ageing;       /* how far the film has moved from its law: fit it again from 1 on */
    float stiffness;    /* change of its stiffness, if nothing else has changed: 0.02 for 2 % more */
    uint32_t limited;   /* SPRINGPOT_BELOW_ZERO and its siblings */
    bool is_lost;       /* no sample of the sensor for too long */
} springpot_tick_output;

typedef struct {
    uint32_t kind;
    float commanded; /* V */
    union {
        springpot_state law;
        springpot_observer_state observer;
        springpot_follower_state follower;
    } of;
} springpot_tick_state;

/* States are stored and compared as words: nothing is padded. */
SPRINGPOT_ASSERT(sizeof(springpot_tick_state) == 2640U, a_state_of_a_tick_takes_2640_bytes);

/* Whether a mode is a law of control, whose voltage is a command. */
static inline bool springpot_tick_controls(uint32_t kind)
{
    return (kind == SPRINGPOT_TICK_FEEDFORWARD) || (kind >= SPRINGPOT_TICK_TRACKING);
}

/* Whether a mode follows the film's temperature. */
static inline bool springpot_tick_warms(const springpot_film *film, uint32_t kind)
{
    return (film->temperature != NULL) && (kind >= SPRINGPOT_TICK_TRACKING);
}

/* Sets all of `state` to a film at rest at x = 0 and 0 V. `kind` is one of SPRINGPOT_TICK_DISPLACEMENT and its siblings. `learns`:
 * feedforward and tracking learn cycles, where the film's file says so. */
static inline void springpot_tick_init(const springpot_film *film, springpot_tick_state *state, uint32_t kind, bool learns)
{
    /* What the mode does not use as well: states are kept as bytes. */
    (void)memset(state, 0, sizeof *state);
    state->kind = kind;
    if (springpot_tick_controls(kind)) {
        springpot_follower_init(film, &state->of.follower, kind != SPRINGPOT_TICK_FEEDFORWARD, learns);
        springpot_follower_set_adapting(
            &state->of.follower, (kind == SPRINGPOT_TICK_ADAPTIVE) ? SPRINGPOT_ADAPT_LEARN : SPRINGPOT_ADAPT_OFF);
    } else if (kind == SPRINGPOT_TICK_OBSERVER) {
        springpot_observer_init(film, &state->of.observer);
    } else {
        springpot_init(film, &state->of.law);
    }
}

/* A tick of `state->kind`. A `u` that is not a number stays in the film for good: refuse it before, or, of a reference, let the last stay. A
 * temperature that springpot_temperature_factors refuses is without effect: refuse it before as well. */
static inline springpot_tick_output springpot_tick(
    const springpot_film *film, springpot_tick_state *state, const springpot_tick_input *in)
{
    const float none = SPRINGPOT_NO_READING;
    springpot_tick_output out = {0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0U, false};
    const springpot_observer_state *observer = NULL;
    springpot_sample sample;
    const springpot_sample *arrived = springpot_is_finite(in->sample) ? &sample : NULL;

    sample.displacement = in->sample;
    sample.age_ticks = in->age_ticks;
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
    } else if (state->kind == SPRINGPOT_TICK_OBSERVER) {
        observer = &state->of.observer;
        out.displacement = springpot_observer_observe(film, &state->of.observer, in->u, arrived);
        out.voltage = in->u;
        out.force = observer->load.force + (observer->load.slope * out.displacement);
        out.limited = springpot_beyond_curve(&observer->film) ? SPRINGPOT_BEYOND_CURVE : 0U;
    } else if (springpot_tick_controls(state->kind)) {
        springpot_follower_state *follower = &state->of.follower;
        const float applied = springpot_is_finite(in->applied) ? in->applied : state->commanded;
        springpot_command command;
        (void)springpot_follower_set_temperature(film, follower, in->celsius);
        out.displacement = springpot_follower_observe(film, follower, applied, in->reading, arrived);
        command = springpot_follower_command(film, follower, in->u);
        state->commanded = command.voltage;
        out.voltage = command.voltage;
        out.force = command.force;
        out.reference = command.reference;
        out.limited = command.limited;
        if (follower->has_sensor != 0U) {
            observer = &follower->of.tracking.observer;
            out.ageing = follower->of.tracking.adaptation.ageing;
            out.stiffness = springpot_follower_stiffness_change(film, follower);
        }
    } else {
        const springpot_load load = springpot_load_of(&film->drive, in->u);
        out.displacement = springpot_displacement_under(film, &state->of.law, load);
        out.voltage = in->u;
        out.force = load.force + (load.slope * out.displacement);
        out.limited = springpot_beyond_curve(&state->of.law) ? SPRINGPOT_BEYOND_CURVE : 0U;
    }
    /* It acts as the largest one. */
    if (((state->kind == SPRINGPOT_TICK_FILM) || (state->kind == SPRINGPOT_TICK_OBSERVER))
        && (springpot_size(in->u) > film->drive.max_voltage)) {
        out.limited |= SPRINGPOT_MAX_VOLTAGE;
    }
    if (observer != NULL) {
        out.disturbance = observer->disturbance;
        out.force_scale = observer->force_scale;
        out.is_lost = observer->since_sample > film->observer.lost_after;
    }
    return out;
}

#endif /* SPRINGPOT_TICK_H */
