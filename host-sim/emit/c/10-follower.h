
/* ---- The follower: the whole control law. Feedforward, or tracking where a sensor corrects it, behind learned cycles. One call for each
 * tick, springpot_follower_step, or its two phases where a program acts between them: springpot_follower_observe, then
 * springpot_follower_command or springpot_follower_standby. */

typedef struct {
    uint32_t has_sensor;   /* 1: tracking, 0: feedforward */
    uint32_t has_feedback; /* 1: samples correct the estimate */
    uint32_t learns;       /* 1: cycles are learned */
    uint32_t limited;      /* limits that the last command of this run met */
    uint32_t has_begun;    /* 1: this run has had a reference */
    uint32_t carries_over; /* 1: the next run begins with what was learned before it */
    union {
        springpot_feedforward_state feedforward;
        springpot_tracking_state tracking;
    } of;
    springpot_learning_state learning;
} springpot_follower_state;

SPRINGPOT_ASSERT(sizeof(springpot_follower_state) == 2632U, a_state_of_a_follower_takes_2632_bytes);

/* A film at rest, 0 V, the reference where the film is. `has_sensor`: tracking, with all that samples correct; otherwise feedforward.
 * `learns`: cycles are learned, if the film's `learning` is not NULL. */
static inline void springpot_follower_init(
    const springpot_film *film, springpot_follower_state *state, bool has_sensor, bool learns)
{
    state->has_sensor = has_sensor ? 1U : 0U;
    state->has_feedback = 1U;
    state->learns = (learns && (film->learning != NULL)) ? 1U : 0U;
    state->limited = 0U;
    state->has_begun = 1U;
    state->carries_over = 0U;
    if (has_sensor) {
        springpot_tracking_init(film, &state->of.tracking);
    } else {
        springpot_feedforward_init(film, &state->of.feedforward);
    }
    springpot_learning_init(film, &state->learning, 0.0F);
}

/* First phase: steps the film under the voltage `commanded_v` (V, either sign) that was really applied since the last tick, after all
 * limits and supervisors; 0 V before the first. `reading_v`: what a monitor measured at the end of that time, or SPRINGPOT_NO_READING.
 * Corrects it with `sample`, or NULL where none has arrived. Returns the estimated displacement (m). */
static inline float springpot_follower_observe(const springpot_film *film, springpot_follower_state *state, float commanded_v,
    float reading_v, const springpot_sample *sample)
{
    const springpot_sample *corrects = (state->has_feedback != 0U) ? sample : NULL;
    float displacement;

    if ((state->learns != 0U) && (sample != NULL)) {
        springpot_learning_observe(&state->learning, sample);
    }
    if (state->has_sensor != 0U) {
        displacement = springpot_tracking_observe(film, &state->of.tracking, commanded_v, reading_v, corrects);
    } else {
        displacement = springpot_feedforward_apply(film, &state->of.feedforward, commanded_v, reading_v);
    }
    return displacement;
}

/* The command of the part behind learned cycles. */
static inline springpot_command springpot_follower_invert(
    const springpot_film *film, springpot_follower_state *state, float reference_m)
{
    return (state->has_sensor != 0U) ? springpot_tracking_command(film, &state->of.tracking, reference_m)
                                     : springpot_feedforward_command(film, &state->of.feedforward, reference_m);
}

static inline void springpot_follower_leave_cycles(springpot_follower_state *state, float taken_over)
{
    if (state->has_sensor != 0U) {
        springpot_tracking_leave_cycles(&state->of.tracking, taken_over);
    }
}

/* Second phase: the voltage that takes the film to `reference_m` (m) at the end of this tick, as far as the limits allow. A reference that
 * is not finite is ignored: the last one stays. */
static inline springpot_command springpot_follower_command(
    const springpot_film *film, springpot_follower_state *state, float reference_m)
{
    float followed = reference_m;
    springpot_command command;

    if (state->learns != 0U) {
        if (state->has_begun == 0U) {
            springpot_learning_restart(film, &state->learning, reference_m, state->carries_over != 0U);
            state->limited = 0U;
            state->has_begun = 1U;
            state->carries_over = 0U;
        }
        followed = springpot_learning_advance(film, &state->learning, reference_m, state->limited);
        springpot_follower_leave_cycles(state, state->learning.progress.taken_over);
    }
    command = springpot_follower_invert(film, state, followed);
    state->limited = command.limited;
    return command;
}

/* Both phases of a tick. */
static inline springpot_command springpot_follower_step(const springpot_film *film, springpot_follower_state *state,
    float commanded_v, float reading_v, const springpot_sample *sample, float reference_m)
{
    (void)springpot_follower_observe(film, state, commanded_v, reading_v, sample);
    return springpot_follower_command(film, state, reference_m);
}

/* Ends a run: the next command begins one. Learned cycles begin anew with it, unless springpot_follower_carry_over was called. */
static inline void springpot_follower_end_run(springpot_follower_state *state)
{
    if (state->learns != 0U) {
        state->has_begun = 0U;
        state->learning.has_arrived = 0U;
        springpot_follower_leave_cycles(state, 0.0F);
    }
}

/* Second phase of a tick whose voltage something else sets: ends the run, and takes the reference to where the film is, with all of the
 * sensor's correction in use. Returns the command that would hold the film there. */
static inline springpot_command springpot_follower_standby(const springpot_film *film, springpot_follower_state *state)
{
    float position = state->of.feedforward.film.position;

    springpot_follower_end_run(state);
    if (state->has_sensor != 0U) {
        springpot_tracking_correct_fully(&state->of.tracking);
        position = state->of.tracking.observer.film.position;
    }
    return springpot_follower_invert(film, state, position);
}

/* What learned cycles add to the reference of this run now (m). */
static inline float springpot_follower_added(const springpot_follower_state *state)
{
    return ((state->learns != 0U) && (state->has_begun != 0U)) ? state->learning.lagged[1] : 0.0F;
}

/* From now on samples correct the estimate, as at first, or they do not: feedforward from what the sensor has shown so far. Cycles are
 * learned from them either way. */
static inline void springpot_follower_set_feedback(springpot_follower_state *state, bool is_on)
{
    state->has_feedback = is_on ? 1U : 0U;
}

/* The next run begins with what was learned of cycles before it. */
static inline void springpot_follower_carry_over(springpot_follower_state *state)
{
    state->carries_over = 1U;
}

/* Forgets what was learned of cycles. What is added fades out. */
static inline void springpot_follower_forget_cycles(const springpot_film *film, springpot_follower_state *state)
{
    springpot_learning_forget(film, &state->learning);
    state->carries_over = 0U;
}

/* springpot_tracking_set_adapting; without effect on feedforward. */
static inline void springpot_follower_set_adapting(springpot_follower_state *state, uint32_t adapting)
{
    if (state->has_sensor != 0U) {
        springpot_tracking_set_adapting(&state->of.tracking, adapting);
    }
}

/* springpot_tracking_adapted; of feedforward the law as it was fitted. */
static inline springpot_adapted springpot_follower_adapted(const springpot_film *film, const springpot_follower_state *state)
{
    const springpot_adapted fitted = {1.0F, film->adaptation.parameters[0].expected, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F};
    return (state->has_sensor != 0U) ? springpot_tracking_adapted(film, &state->of.tracking) : fitted;
}

/* springpot_tracking_stiffness_change; 0 of feedforward. */
static inline float springpot_follower_stiffness_change(const springpot_film *film, const springpot_follower_state *state)
{
    return (state->has_sensor != 0U) ? springpot_tracking_stiffness_change(film, &state->of.tracking) : 0.0F;
}

/* springpot_tracking_restore; false for feedforward. */
static inline bool springpot_follower_restore(
    const springpot_film *film, springpot_follower_state *state, const springpot_adapted *adapted)
{
    return (state->has_sensor != 0U) && springpot_tracking_restore(film, &state->of.tracking, adapted);
}

/* springpot_tracking_set_temperature_factors; false for feedforward. */
static inline bool springpot_follower_set_temperature_factors(
    const springpot_film *film, springpot_follower_state *state, float stiffness, float time)
{
    return (state->has_sensor != 0U) && springpot_tracking_set_temperature_factors(film, &state->of.tracking, stiffness, time);
}

/* The film is at `celsius` (degrees C) from now on: springpot_tracking_set_temperature_factors of springpot_temperature_factors. Returns false for
 * feedforward, and where either does; then nothing changes. */
static inline bool springpot_follower_set_temperature(const springpot_film *film, springpot_follower_state *state, float celsius)
{
    float factors[2];
    return springpot_temperature_factors(film, celsius, factors)
        && springpot_follower_set_temperature_factors(film, state, factors[0], factors[1]);
}

/* springpot_tracking_forget_changes. */
static inline void springpot_follower_forget_changes(springpot_follower_state *state)
{
    if (state->has_sensor != 0U) {
        springpot_tracking_forget_changes(&state->of.tracking);
    }
}

/* Resets disturbance and force scale to 0 and 1, and what was learned of a film that changes: the model as it was fitted. */
static inline void springpot_follower_forget_correction(springpot_follower_state *state)
{
    if (state->has_sensor != 0U) {
        springpot_tracking_forget(&state->of.tracking);
    }
}
