/* Ends a block for a harmonic: E = `scale` times its sum, each part of which noise gives the `variance` (m^2). Whether E is more than
 * noise. */
static inline bool springpot_update_harmonic(const springpot_learning *learning, springpot_harmonic *harmonic, float scale,
    float variance, bool may_be_unresponsive)
{
    const float error[2] = {scale * harmonic->sum[0], scale * harmonic->sum[1]};
    /* P = dE / dA, where both are far above the noise. */
    const float response[2] = {error[0] - harmonic->error[0], error[1] - harmonic->error[1]};
    const float change[2] = {harmonic->target[0] - harmonic->previous_target[0], harmonic->target[1] - harmonic->previous_target[1]};
    const float threshold = learning->significance * variance;
    const float response_power = springpot_square(response);
    const float changed = springpot_square(change);
    bool is_more = false;

    harmonic->error[0] = error[0];
    harmonic->error[1] = error[1];
    harmonic->previous_target[0] = harmonic->target[0];
    harmonic->previous_target[1] = harmonic->target[1];
    if ((changed > threshold) && (response_power > threshold) && (response_power > 0.0F)) {
        const float inverse_gain[2] = {
            ((change[0] * response[0]) + (change[1] * response[1])) / response_power,
            ((change[1] * response[0]) - (change[0] * response[1])) / response_power,
        };
        const float size = springpot_square(inverse_gain);
        if (size > learning->inverse_gains[1]) {
            harmonic->unresponsive_blocks = harmonic->unresponsive_blocks + ((harmonic->unresponsive_blocks < 255U) ? 1U : 0U);
        } else if (size > learning->inverse_gains[0]) {
            harmonic->inverse_gain[0] = inverse_gain[0];
            harmonic->inverse_gain[1] = inverse_gain[1];
            harmonic->step_size = learning->step_size;
            harmonic->unresponsive_blocks = 0U;
        } else {
            /* too large a response to be one */
        }
    } else if (changed > (learning->inverse_gains[1] * threshold)) {
        harmonic->unresponsive_blocks = harmonic->unresponsive_blocks + ((harmonic->unresponsive_blocks < 255U) ? 1U : 0U);
    } else {
        /* too small a change to show anything */
    }
    if ((harmonic->unresponsive_blocks >= learning->unresponsive_blocks) && may_be_unresponsive) {
        harmonic->target[0] = 0.0F;
        harmonic->target[1] = 0.0F;
    } else {
        /* The share of the way falls where E is not above what noise gives. */
        const float energy = springpot_square(error);
        const float noise = 4.0F * variance;
        const float weight = (energy * energy) / ((energy * energy) + (noise * noise));
        const float share = (energy > 0.0F) ? (harmonic->step_size * weight) : 0.0F;
        const float re = harmonic->inverse_gain[0];
        const float im = harmonic->inverse_gain[1];
        harmonic->target[0] = harmonic->target[0] - (share * ((re * error[0]) - (im * error[1])));
        harmonic->target[1] = harmonic->target[1] - (share * ((re * error[1]) + (im * error[0])));
        is_more = energy > threshold;
    }
    return is_more;
}

/* Ends a block. What the harmonics do not explain of the error is noise. */
static inline void springpot_complete_block(springpot_learning_state *state)
{
    springpot_block *block = &state->block;
    float explained = 0.5F * springpot_square(state->harmonics[0].sum);
    float residual;
    uint32_t i;

    block->scale = 2.0F / block->samples;
    for (i = 1U; i <= SPRINGPOT_HARMONICS; i++) {
        explained = explained + springpot_square(state->harmonics[i].sum);
    }
    residual = block->sum_of_squares - (block->scale * explained);
    block->variance = (residual > 0.0F) ? ((block->scale * residual) / block->samples) : 0.0F;
    block->has_ended = 1U;
    block->is_short = 0U;
    block->ticks_since_end = 0.0F;
}

/* Takes the sample that has arrived since the round before, or ends the block. */
static inline void springpot_begin_round(const springpot_learning *learning, springpot_learning_state *state)
{
    const float visits = (float)(SPRINGPOT_HARMONICS + 1U);
    springpot_block *block = &state->block;
    const springpot_turn *measured = &state->past[state->arrived_at % SPRINGPOT_PAST];
    const float error = state->arrived - measured->reference;
    const bool is_seen = (state->has_arrived != 0U) && springpot_is_finite(error);
    /* Keeps the phase on the circle: a step of Newton's method. */
    const float keep =
        1.5F - (0.5F * ((state->phase[0] * state->phase[0]) + (state->phase[1] * state->phase[1])));
    const float on = (state->angle > 0.0F) ? 1.0F : 0.0F;
    uint32_t which;
    float settling;
    bool closed = false;

    state->power[0] = 1.0F;
    state->power[1] = 0.0F;
    state->error = 0.0F;
    state->phase[0] = state->phase[0] * keep;
    state->phase[1] = state->phase[1] * keep;
    state->fade = state->fade + (learning->fade_weight * (on - state->fade));
    state->has_arrived = 0U;
    block->ticks = block->ticks + visits;
    block->ticks_since_end = block->ticks_since_end + visits;
    which = ((learning->rate * state->angle) < learning->turn) ? 0U : 1U;
    settling = learning->settling_s[which] * learning->rate;
    if (!((block->ticks < settling) || (state->angle <= 0.0F))) {
        block->angle = block->angle + (visits * state->angle);
        if (block->angle >= block->next_end) {
            const float least = learning->min_block_s[(block->is_short != 0U) ? 0U : 1U] * learning->rate;
            block->next_end = block->next_end + learning->turn;
            if ((block->ticks >= (settling + least)) && (block->samples >= learning->min_samples)) {
                springpot_complete_block(state);
                closed = true;
            }
        }
        if ((!closed) && is_seen) {
            block->samples = block->samples + 1.0F;
            block->sum_of_squares = block->sum_of_squares + (error * error);
            state->error = error;
            state->unit[0] = measured->phase[0];
            state->unit[1] = measured->phase[1];
        }
    }
}

/* Updates one harmonic. */
static inline void springpot_visit(const springpot_learning *learning, springpot_learning_state *state)
{
    /* After the last one the first. */
    const uint32_t index = (state->index <= SPRINGPOT_HARMONICS) ? state->index : 0U;
    springpot_harmonic *harmonic = &state->harmonics[index];
    float cosine;
    float sine;

    if (index == 0U) {
        springpot_begin_round(learning, state);
    }
    state->index = index + 1U;
    cosine = state->power[0];
    sine = state->power[1];
    state->power[0] = (cosine * state->unit[0]) - (sine * state->unit[1]);
    state->power[1] = (cosine * state->unit[1]) + (sine * state->unit[0]);
    harmonic->added[0] = harmonic->added[0] + (learning->approach * (harmonic->target[0] - harmonic->added[0]));
    harmonic->added[1] = harmonic->added[1] + (learning->approach * (harmonic->target[1] - harmonic->added[1]));
    if (state->block.has_ended == 0U) {
        harmonic->sum[0] = harmonic->sum[0] + (state->error * cosine);
        harmonic->sum[1] = harmonic->sum[1] - (state->error * sine);
    } else {
        const bool is_learned = (index <= learning->harmonics)
            && (((float)index * state->angle) <= learning->largest_angle);
        /* The mean has half of what a harmonic has of the sum. */
        const float scale = (index == 0U) ? (0.5F * state->block.scale) : state->block.scale;
        if (is_learned) {
            const bool is_more = springpot_update_harmonic(learning, harmonic, scale, state->block.variance, index > 0U);
            if (is_more) {
                state->block.is_short = 1U;
            }
        }
        if (index == SPRINGPOT_HARMONICS) {
            state->has_learned = 1U;
            springpot_begin_block(learning, state);
        }
    }
}

/* The mean and the harmonics at the present phase, m: Clenshaw's recurrence. */
static inline float springpot_sum(const springpot_learning_state *state)
{
    const float cosine = state->phase[0];
    const float sine = state->phase[1];
    const float twice = cosine + cosine;
    float one[2] = {0.0F, 0.0F};
    float two[2] = {0.0F, 0.0F};
    uint32_t i;

    SPRINGPOT_UNROLL
    for (i = SPRINGPOT_HARMONICS; i > 0U; i--) {
        const float re = (state->harmonics[i].added[0] + (twice * one[0])) - two[0];
        const float im = (state->harmonics[i].added[1] + (twice * one[1])) - two[1];
        two[0] = one[0];
        two[1] = one[1];
        one[0] = re;
        one[1] = im;
    }
    return (state->harmonics[0].added[0] + ((one[0] * cosine) - two[0])) - (one[1] * sine);
}

/* Takes a sample that has arrived, before springpot_learning_advance of the same tick. One that is too old is ignored. */
static inline void springpot_learning_observe(springpot_learning_state *state, const springpot_sample *sample)
{
    /* What is remembered will be overwritten before the next round is over: a sample must be younger by that. */
    if (sample->age_ticks < (SPRINGPOT_PAST - (SPRINGPOT_HARMONICS + 2U))) {
        state->has_arrived = 1U;
        state->arrived = sample->displacement;
        state->arrived_at = (state->newest + sample->age_ticks) % SPRINGPOT_PAST;
    }
}

/* In every tick, before the command: the reference to follow at the end of this tick (m) instead of `reference_m` (m). `limited`: limits that
 * the command before met; nothing is learned from blocks with limits. A reference that is not finite is passed on. */
static inline float springpot_learning_advance(
    const springpot_film *film, springpot_learning_state *state, float reference_m, uint32_t limited)
{
    const springpot_learning *learning = film->learning;
    float followed = reference_m;

    if (learning != NULL) {
        const float cosine = state->phase[0];
        const float sine = state->phase[1];
        state->phase[0] = (cosine * state->rotation[0]) - (sine * state->rotation[1]);
        state->phase[1] = (cosine * state->rotation[1]) + (sine * state->rotation[0]);
        if (learning->period <= 0.0F) {
            springpot_track_period(learning, state, reference_m);
        }
        state->newest = (state->newest + (SPRINGPOT_PAST - 1U)) % SPRINGPOT_PAST;
        state->past[state->newest].reference = reference_m;
        state->past[state->newest].phase[0] = state->phase[0];
        state->past[state->newest].phase[1] = state->phase[1];
        if (limited != 0U) {
            /* The block shows nothing. Where limits leave no block, what was learned may be why. */
            if (state->block.has_ended == 0U) {
                springpot_begin_block(learning, state);
            }
            if (state->block.ticks_since_end > (learning->max_block_s * learning->rate)) {
                uint32_t i;
                state->block.ticks_since_end = 0.0F;
                for (i = 0U; i <= SPRINGPOT_HARMONICS; i++) {
                    state->harmonics[i].target[0] = 0.5F * state->harmonics[i].target[0];
                    state->harmonics[i].target[1] = 0.5F * state->harmonics[i].target[1];
                }
            }
        }
        springpot_visit(learning, state);
        state->lagged[0] =
            state->lagged[0] + (learning->smoothing * ((state->fade * springpot_sum(state)) - state->lagged[0]));
        state->lagged[1] = state->lagged[1] + (learning->smoothing * (state->lagged[0] - state->lagged[1]));
        followed = reference_m + state->lagged[1];
    }
    return followed;
}

