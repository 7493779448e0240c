/* ---- Feedforward: a voltage for a reference, without a sensor. */

/* A film at rest, 0 V, the reference where the film is. For a film that has been loaded before, warm up `state->film` with
 * springpot_displacement, one call for each step of its history, then zero the displacement with springpot_move_origin. */
static inline void springpot_feedforward_init(const springpot_film *film, springpot_feedforward_state *state)
{
    springpot_init(film, &state->film);
    springpot_inverse_init(&state->inverse, state->film.position);
}

/* First in a tick: steps the film under the voltage `commanded_v` (V, either sign) that was really applied since the last tick, after
 * all limits and supervisors; 0 V before the first. `reading_v`: what a monitor measured at the end of that time, or
 * SPRINGPOT_NO_READING. Returns the displacement (m). */
static inline float springpot_feedforward_apply(
    const springpot_film *film, springpot_feedforward_state *state, float commanded_v, float reading_v)
{
    const float voltage = springpot_record(film, &state->inverse, commanded_v, reading_v);
    return springpot_displacement_under(film, &state->film, springpot_load_of(&film->drive, voltage));
}

/* Then: the voltage that takes the film to `reference_m` (m) at the end of this tick, as far as the limits allow. A reference that is
 * not finite is ignored: the last one stays. */
static inline springpot_command springpot_feedforward_command(
    const springpot_film *film, springpot_feedforward_state *state, float reference_m)
{
    return springpot_invert(film, &state->film, &state->inverse, reference_m, 0.0F, 1.0F);
}

/* ---- The observer: an estimate of the film from voltage and samples of its displacement. */

/* A film at rest, without disturbance. */
static inline void springpot_observer_init(const springpot_film *film, springpot_observer_state *state)
{
    uint32_t i;

    springpot_init(film, &state->film);
    state->integral = 0.0F;
    state->slope = 0.0F;
    state->proportional = 0.0F;
    state->disturbance = 0.0F;
    state->force_scale = 1.0F;
    state->integral_mean = 0.0F;
    state->load_mean = 0.0F;
    state->excitation = 0.0F;
    state->since_sample = 0U;
    state->innovation = 0.0F;
    state->innovation_mean = 0.0F;
    state->innovation_variance = 0.0F;
    state->load = springpot_load_of(&film->drive, 0.0F);
    state->share = 1.0F;
    state->gains = film->observer.gains;
    state->adapting = film->observer.adapting;
    state->newest = 0U;
    for (i = 0U; i < SPRINGPOT_PAST; i++) {
        state->past[i] = state->film.position;
    }
}

/* Corrects with an innovation (m): a sample minus the prediction for its time. */
static inline void springpot_take(
    const springpot_observer *observer, springpot_observer_state *state, float innovation)
{
    const float bounded = springpot_clamp(innovation, -observer->max_innovation, observer->max_innovation);
    /* A sample weighs as much as the time since the last one, but no more after a loss. */
    const float ticks =
        (float)((state->since_sample < observer->lost_after) ? state->since_sample : observer->lost_after);
    const float share = observer->statistics;
    const float difference = bounded - state->innovation_mean;
    const float step = share * difference;
    /* A film behind a curve is as much stiffer here as the curve is steeper: so are the gains. */
    const float scaled = state->film.slope * bounded;

    state->since_sample = 0U;
    state->innovation = bounded;
    state->innovation_mean = state->innovation_mean + step;
    state->innovation_variance = state->innovation_variance
        + (((difference * (difference - step)) * share) - (share * state->innovation_variance));
    state->proportional = state->gains.proportional * scaled;
    state->slope = springpot_clamp(
        state->slope + ((state->gains.slope * ticks) * scaled), -observer->max_slope, observer->max_slope);
    state->integral = state->integral + ((state->gains.integral * ticks) * scaled);
}

/* Reads a sample, if there is one, and moves the disturbance on by a tick. */
static inline void springpot_correct(
    const springpot_observer *observer, springpot_observer_state *state, const springpot_sample *sample)
{
    bool lost;

    if (state->since_sample < UINT32_MAX) {
        state->since_sample = state->since_sample + 1U;
    }
    if ((sample != NULL) && (sample->age_ticks < SPRINGPOT_PAST)) {
        const uint32_t place = (state->newest + sample->age_ticks) % SPRINGPOT_PAST;
        const float innovation = sample->displacement - state->past[place];
        if (springpot_is_finite(innovation)) {
            springpot_take(observer, state, innovation);
        }
    }
    lost = state->since_sample > observer->lost_after;
    if (lost) {
        state->slope = 0.0F;
        state->proportional = 0.0F;
        state->integral = state->integral + (observer->recovery * (state->integral_mean - state->integral));
    } else {
        const float corrected = springpot_clamp(
            state->integral + state->slope, -observer->max_disturbance, observer->max_disturbance);
        state->integral_mean = state->integral_mean + (observer->averaging * (corrected - state->integral_mean));
        state->integral = corrected;
    }
    state->disturbance = state->disturbance
        + (observer->smoothing * ((state->integral + state->proportional) - state->disturbance));
}

/* Moves the part of the disturbance that varies with the load (N) to the force scale: recursive least squares of one number. */
static inline void springpot_adapt(const springpot_observer *observer, springpot_observer_state *state, float load)
{
    float deviation;
    float adapting;
    float unexplained;
    float change;
    float scale;
    float growth;

    state->load_mean = state->load_mean + (observer->averaging * (load - state->load_mean));
    deviation = load - state->load_mean;
    state->excitation =
        state->excitation + ((deviation * deviation) - (observer->forgetting * state->excitation));
    /* Nothing is learned without the sensor, and of a load that stays: its noise is the answer to that of the sensor. */
    adapting = ((state->since_sample <= observer->lost_after) && (fabsf(deviation) > observer->excited)) ? state->adapting : 0.0F;
    unexplained = state->integral - state->integral_mean;
    change = ((adapting * unexplained) * deviation) / (state->excitation + observer->regularisation);
    scale = springpot_clamp(
        state->force_scale + (change * state->force_scale), observer->scales[0], observer->scales[1]);
    growth = (scale - state->force_scale) / state->force_scale;
    state->integral = state->integral - (growth * load);
    state->disturbance = state->disturbance - (growth * load);
    state->integral_mean = state->integral_mean - (growth * state->load_mean);
    state->force_scale = scale;
}

/* Steps the film under `state->load`, and corrects it with a sample, or NULL where none has arrived. Returns the estimated displacement
 * (m). */
static inline float springpot_observer_step(
    const springpot_film *film, springpot_observer_state *state, const springpot_sample *sample)
{
    const springpot_load load = state->load;
    const float electrostatic = (load.force - film->drive.preload) * state->force_scale;
    springpot_load forced;
    float position;

    forced.force = (electrostatic + film->drive.preload) + state->disturbance;
    forced.slope = load.slope * state->force_scale;
    position = springpot_displacement_under(film, &state->film, forced);
    state->newest = (state->newest + (SPRINGPOT_PAST - 1U)) % SPRINGPOT_PAST;
    state->past[state->newest] = position;
    springpot_correct(&film->observer, state, sample);
    springpot_adapt(&film->observer, state, electrostatic + (forced.slope * position));
    return position;
}

/* In every tick: steps the film under the voltage `voltage_v` (V, either sign) that was applied since the last tick, and corrects it with
 * a sample, or NULL where none has arrived. Returns the estimated displacement (m). After a voltage that is not finite the last one
 * stays. */
static inline float springpot_observer_observe(const springpot_film *film, springpot_observer_state *state, float voltage_v,
    const springpot_sample *sample)
{
    if (springpot_is_finite(voltage_v)) {
        state->load = springpot_load_of(&film->drive, voltage_v);
    }
    return springpot_observer_step(film, state, sample);
}

/* ---- Tracking: a voltage for a reference, with a sensor. */

static inline void springpot_fade_init(springpot_fade_state *state, float position)
{
    state->position = position;
    state->high_passed = 0.0F;
    state->net_excursion = 0.0F;
    state->path_length[0] = 0.0F;
    state->path_length[1] = 0.0F;
    state->share = 1.0F;
}

/* A film at rest, 0 V, the reference where the film is. A film that has been loaded before: as for springpot_feedforward_init, with
 * `state->observer.film`. */
static inline void springpot_tracking_init(const springpot_film *film, springpot_tracking_state *state)
{
    springpot_observer_init(film, &state->observer);
    springpot_inverse_init(&state->inverse, state->observer.film.position);
    springpot_fade_init(&state->fade, state->observer.film.position);
    state->most = 1.0F;
    state->limited = 0U;
    springpot_adaptation_init(&state->adaptation);
}

/* How much of the correction is in use: less for references that are faster than the observer. */
static inline void springpot_fade_advance(
    const springpot_fade *fade, springpot_fade_state *state, float position, float most)
{
    const float moved = (position - state->position) / fade->high_pass;
    float share;

    state->position = position;
    state->high_passed = state->high_passed + (fade->high_pass * (moved - state->high_passed));
    state->net_excursion = state->net_excursion + (fade->averaging * (springpot_size(state->high_passed) - state->net_excursion));
    state->path_length[0] = state->path_length[0] + (fade->averaging * (springpot_size(moved) - state->path_length[0]));
    state->path_length[1] = state->path_length[1] + (fade->high_pass * (state->path_length[0] - state->path_length[1]));
    share = fade->intercept - (fade->slope * (state->path_length[1] / (state->net_excursion + fade->floor)));
    share = (share > most) ? most : share;
    share = (share < fade->min_share) ? fade->min_share : share;
    state->share = state->share + (fade->smoothing * (share - state->share));
}

/* From now on this share of the correction is in use. */
static inline void springpot_set_share(
    const springpot_observer *observer, springpot_observer_state *state, float share)
{
    const float square = share * share;
    state->share = share;
    state->gains.proportional = square * observer->gains.proportional;
    state->gains.integral = share * observer->gains.integral;
    state->gains.slope = square * observer->gains.slope;
    state->adapting = (share > observer->full_share) ? observer->adapting : 0.0F;
    state->slope = state->slope - ((observer->forgetting_slope * (1.0F - share)) * state->slope);
}

/* First in a tick: as springpot_feedforward_apply, corrected with a sample, or NULL where none has arrived. Returns the estimated
 * displacement (m). */
static inline float springpot_tracking_observe(const springpot_film *film, springpot_tracking_state *state, float commanded_v,
    float reading_v, const springpot_sample *sample)
{
    const float voltage = springpot_record(film, &state->inverse, commanded_v, reading_v);
    const bool changes = state->adaptation.is_in_use != 0U;
    float position;

    if (sample != NULL) {
        springpot_fade_advance(&film->fade, &state->fade, state->inverse.path.position, state->most);
        springpot_set_share(&film->observer, &state->observer, state->fade.share);
    }
    state->observer.load = springpot_load_of(&film->drive, voltage);
    if (changes) {
        /* The force scale is adapted with the rest. */
        state->observer.adapting = 0.0F;
    }
    position = springpot_observer_step(film, &state->observer, sample);
    if (changes) {
        springpot_adaptation_advance(film, &state->adaptation, &state->observer, state->limited);
    }
    return position;
}

/* Then: as springpot_feedforward_command, with the observer's disturbance subtracted. */
static inline springpot_command springpot_tracking_command(
    const springpot_film *film, springpot_tracking_state *state, float reference_m)
{
    const springpot_command command = springpot_invert(film, &state->observer.film, &state->inverse, reference_m,
        state->observer.disturbance, state->observer.force_scale);
    state->limited = command.limited;
    return command;
}

/* All of the correction is in use until the reference has moved again: for a voltage that does not follow the sensor. */
static inline void springpot_tracking_correct_fully(springpot_tracking_state *state)
{
    springpot_fade_init(&state->fade, state->inverse.path.position);
}

/* From now on the observer leaves the errors of cycles to learning, by the share (0 to 1) that it has taken over. */
static inline void springpot_tracking_leave_cycles(springpot_tracking_state *state, float taken_over)
{
    state->most = 1.0F - taken_over;
}

/* From now on the law follows a film that changes, stays as it has followed it, or as it was fitted: SPRINGPOT_ADAPT_LEARN, _HOLD, or
 * _OFF, as at first. Other numbers count as _OFF. */
static inline void springpot_tracking_set_adapting(springpot_tracking_state *state, uint32_t adapting)
{
    springpot_adaptation_state *adaptation = &state->adaptation;
    const bool follows = (adapting == SPRINGPOT_ADAPT_HOLD) || (adapting == SPRINGPOT_ADAPT_LEARN);

    if (!follows) {
        springpot_adaptation_forget(adaptation);
        adaptation->stated[0] = 0.0F;
        adaptation->stated[1] = 0.0F;
    } else if (adaptation->is_in_use == 0U) {
        springpot_adaptation_init(adaptation);
        adaptation->is_in_use = 1U;
    } else {
        /* goes on */
    }
    adaptation->adapting = follows ? adapting : SPRINGPOT_ADAPT_OFF;
}

/* How the film differs from its law, as far as that was learned. */
static inline springpot_adapted springpot_tracking_adapted(const springpot_film *film, const springpot_tracking_state *state)
{
    const springpot_adaptation_state *adaptation = &state->adaptation;
    springpot_adapted adapted;

    adapted.force_scale = (adaptation->is_in_use != 0U)
        ? springpot_exp(&film->adaptation, adaptation->used[SPRINGPOT_ADAPTED_SCALE])
        : state->observer.force_scale;
    adapted.uncertainty = springpot_uncertainty(&film->adaptation, adaptation);
    adapted.memory = adaptation->used[SPRINGPOT_ADAPTED_MEMORY];
    adapted.rate = adaptation->used[SPRINGPOT_ADAPTED_RATE];
    adapted.stretch = adaptation->used[SPRINGPOT_ADAPTED_STRETCH];
    adapted.bias_n = adaptation->used[SPRINGPOT_ADAPTED_BIAS];
    adapted.ageing = adaptation->ageing;
    return adapted;
}

/* By how much the film's stiffness differs from its law's, if nothing else does: 0.02 for 2 % more. 0 below 1.25 %, and for what may be chance: three
 * uncertainties when it was last learned. A change of something else shows as well, as the stiffness that explains it best. */
static inline float springpot_tracking_stiffness_change(const springpot_film *film, const springpot_tracking_state *state)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const springpot_adaptation_state *adapting = &state->adaptation;
    const float expected = adaptation->parameters[SPRINGPOT_ADAPTED_SCALE].expected;
    const float by_chance = adaptation->by_chance * (expected * sqrtf(adapting->doubt));
    float left[SPRINGPOT_ADAPTED_BIAS];
    float covariance[SPRINGPOT_ADAPTED_BIAS][SPRINGPOT_ADAPTED_BIAS];
    float scale;
    uint32_t from;
    uint32_t i;
    uint32_t j;

    /* The estimate of the scale if memory, rate and stretch are 0, whatever the bias is: what they explain goes, one after another. */
    for (i = 0U; i < SPRINGPOT_ADAPTED_BIAS; i++) {
        left[i] = adapting->estimates[i] / adaptation->parameters[i].expected;
        for (j = 0U; j < SPRINGPOT_ADAPTED_BIAS; j++) {
            covariance[i][j] = springpot_covariance(adapting, i, j);
        }
    }
    for (from = SPRINGPOT_ADAPTED_BIAS - 1U; from > 0U; from--) {
        for (i = 0U; i < from; i++) {
            const float share = covariance[from][i] / covariance[from][from];
            left[i] = left[i] - (share * left[from]);
            for (j = 0U; j < from; j++) {
                covariance[i][j] = covariance[i][j] - (share * covariance[from][j]);
            }
        }
    }
    scale = expected * left[SPRINGPOT_ADAPTED_SCALE];
    if ((springpot_size(scale) > adaptation->min_change) && (springpot_size(scale) > by_chance)) {
        return springpot_exp(adaptation, -scale) - 1.0F;
    }
    return 0.0F;
}

/* Uses what was learned of the film before, and holds it: after a restart, for a film at rest. Returns false for numbers that cannot have been
 * learned; then nothing changes. */
static inline bool springpot_tracking_restore(
    const springpot_film *film, springpot_tracking_state *state, const springpot_adapted *adapted)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const float stated[2] = {state->adaptation.stated[0], state->adaptation.stated[1]};
    const float doubt = adapted->uncertainty / adaptation->parameters[SPRINGPOT_ADAPTED_SCALE].expected;
    bool is_sound = (adapted->force_scale > 0.0F) && springpot_is_finite(adapted->uncertainty) && springpot_is_finite(adapted->ageing);
    float used[SPRINGPOT_PARAMETERS];
    uint32_t i;

    used[SPRINGPOT_ADAPTED_SCALE] = springpot_logarithm(adaptation, adapted->force_scale);
    used[SPRINGPOT_ADAPTED_MEMORY] = adapted->memory;
    used[SPRINGPOT_ADAPTED_RATE] = adapted->rate;
    used[SPRINGPOT_ADAPTED_STRETCH] = adapted->stretch;
    used[SPRINGPOT_ADAPTED_BIAS] = adapted->bias_n;
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        is_sound = is_sound && springpot_is_finite(used[i]) && (springpot_size(used[i]) <= adaptation->parameters[i].restored);
    }
    if (is_sound) {
        springpot_adaptation_init(&state->adaptation);
        for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
            state->adaptation.estimates[i] = used[i];
            state->adaptation.used[i] = used[i];
        }
        state->adaptation.stated[0] = stated[0];
        state->adaptation.stated[1] = stated[1];
        state->adaptation.ageing = adapted->ageing;
        state->adaptation.doubt = doubt * doubt;
        state->adaptation.is_in_use = 1U;
        state->adaptation.adapting = SPRINGPOT_ADAPT_HOLD;
    }
    return is_sound;
}

/* Factors of the film's stiffness and of its relaxation times at `celsius` (degrees C). Returns false for a film that was not fitted at several
 * temperatures, and for a temperature out of reach of a running law, which follows 0.25 to 4 and a third to three times. */
static inline bool springpot_temperature_factors(const springpot_film *film, float celsius, float factors[2])
{
    const springpot_temperature *temperature = film->temperature;
    const double zero = 273.15;
    const double gas = 8.314462618e-3;

    if ((temperature == NULL) || !springpot_is_finite(celsius) || !((double)celsius > -zero)) {
        return false;
    }
    {
        const double from = (double)temperature->reference;
        const double per_activation = ((1.0 / ((double)celsius + zero)) - (1.0 / (from + zero))) / gas;
        factors[0] = (float)(1.0 + ((double)temperature->stiffness * ((double)celsius - from)));
        factors[1] = (float)exp((double)temperature->activation * per_activation);
    }
    return (factors[0] >= 0.25F) && (factors[0] <= 4.0F) && (factors[1] >= (1.0F / 3.0F)) && (factors[1] <= 3.0F);
}

/* The film's temperature makes its stiffness and its relaxation times these factors of those of its law: they come into use with a time constant of a
 * second, with or without a sensor, beside what is learned. While nothing is learned this holds; SPRINGPOT_ADAPT_OFF forgets it. Returns false beyond
 * 0.25 to 4 and a third to three times; then nothing changes. */
static inline bool springpot_tracking_set_temperature_factors(
    const springpot_film *film, springpot_tracking_state *state, float stiffness, float time)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const float scale = -springpot_logarithm(adaptation, stiffness);
    const float rate = -springpot_logarithm(adaptation, time);
    const bool is_within = (springpot_size(scale) <= adaptation->parameters[SPRINGPOT_ADAPTED_SCALE].restored)
        && (springpot_size(rate) <= adaptation->parameters[SPRINGPOT_ADAPTED_RATE].restored);

    if (is_within) {
        if (state->adaptation.adapting == SPRINGPOT_ADAPT_OFF) {
            springpot_tracking_set_adapting(state, SPRINGPOT_ADAPT_HOLD);
        }
        state->adaptation.stated[0] = scale;
        state->adaptation.stated[1] = rate;
    }
    return is_within;
}

/* Forgets what was learned of a film that changes: it goes out of use within some seconds. Learning goes on. */
static inline void springpot_tracking_forget_changes(springpot_tracking_state *state)
{
    springpot_adaptation_forget(&state->adaptation);
}

/* Resets disturbance and force scale to 0 and 1, and what was learned of a film that changes: the model as it was fitted, at once. Learning goes
 * on. */
static inline void springpot_tracking_forget(springpot_tracking_state *state)
{
    const uint32_t is_in_use = state->adaptation.is_in_use;
    const uint32_t adapting = state->adaptation.adapting;
    const float stated[2] = {state->adaptation.stated[0], state->adaptation.stated[1]};
    springpot_observer_state *observer = &state->observer;
    observer->integral = 0.0F;
    observer->slope = 0.0F;
    observer->proportional = 0.0F;
    observer->disturbance = 0.0F;
    observer->force_scale = 1.0F;
    observer->integral_mean = 0.0F;
    observer->load_mean = 0.0F;
    observer->excitation = 0.0F;
    springpot_adaptation_init(&state->adaptation);
    state->adaptation.stated[0] = stated[0];
    state->adaptation.stated[1] = stated[1];
    state->adaptation.is_in_use = is_in_use;
    state->adaptation.adapting = adapting;
}

