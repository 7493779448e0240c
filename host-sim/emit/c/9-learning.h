/* Measures how much E changes by itself, from the two blocks before anything is added. Whether that needs another block. */
static inline bool springpot_measure_drift(
    const springpot_learning *learning, springpot_harmonic *harmonic, bool is_fast, float response_power)
{
    const bool is_first = is_fast && (harmonic->drift <= learning->drift_unknown[0]);

    if (!is_fast) {
        harmonic->drift = 0.0F;
    } else if (is_first) {
        harmonic->drift = learning->drift_unknown[1];
    } else if (harmonic->drift < 0.0F) {
        harmonic->drift = response_power;
    } else {
        harmonic->drift = learning->drift_kept * harmonic->drift;
    }
    return is_first;
}

/* Takes P = dE / dA, where dE is far above the noise and the drift. */
static inline void springpot_measure_response(const springpot_learning *learning, springpot_harmonic *harmonic, bool is_mean,
    bool is_fast, const float *change, const float *response, float threshold)
{
    const float changed = springpot_square(change);
    const float response_power = springpot_square(response);

    if ((changed > 0.0F) && (response_power > (threshold + (learning->drift_significance * harmonic->drift)))) {
        const float inverse_gain[2] = {
            ((change[0] * response[0]) + (change[1] * response[1])) / response_power,
            ((change[1] * response[0]) - (change[0] * response[1])) / response_power,
        };
        const float size = springpot_square(inverse_gain);
        if (is_mean
            && ((inverse_gain[0] < learning->mean_inverse_gains[0]) || (inverse_gain[0] > learning->mean_inverse_gains[1]))) {
            /* an error that drifts, not a response */
        } else if (size > learning->inverse_gains[1]) {
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
    } else if (harmonic->step_size < learning->initial_step_size) {
        const float doubled = harmonic->step_size + harmonic->step_size;
        harmonic->step_size = (is_fast && (doubled < learning->initial_step_size)) ? doubled : learning->initial_step_size;
    } else {
        /* too small a change to show anything */
    }
}

/* Takes the sum of a block that has ended. Whether E is more than noise. */
static inline bool springpot_update_harmonic(const springpot_learning *learning, springpot_harmonic *harmonic,
    const springpot_block *block, const springpot_progress *progress, bool is_mean, bool is_fast)
{
    /* The mean has half of what a harmonic has of the sum. */
    const float scale = is_mean ? (0.5F * block->scale) : block->scale;
    const float error[2] = {scale * harmonic->sum[0], scale * harmonic->sum[1]};
    const float response[2] = {error[0] - harmonic->error[0], error[1] - harmonic->error[1]};
    const float change[2] = {harmonic->target[0] - harmonic->previous_target[0], harmonic->target[1] - harmonic->previous_target[1]};
    const float threshold = learning->significance * block->variance;
    bool is_more = true;

    harmonic->error[0] = error[0];
    harmonic->error[1] = error[1];
    harmonic->previous_target[0] = harmonic->target[0];
    harmonic->previous_target[1] = harmonic->target[1];
    if (progress->verdict == SPRINGPOT_BEST) {
        harmonic->best[0] = harmonic->target[0];
        harmonic->best[1] = harmonic->target[1];
    }
    if (progress->verdict == SPRINGPOT_HARMFUL) {
        springpot_clear_harmonic(learning, harmonic);
    } else if (progress->verdict == SPRINGPOT_SETTLING) {
        /* nothing is added yet */
    } else if (!springpot_measure_drift(learning, harmonic, is_fast, springpot_square(response))) {
        springpot_measure_response(learning, harmonic, is_mean, is_fast, change, response, threshold);
        if ((harmonic->unresponsive_blocks >= learning->unresponsive_blocks) && (!is_mean)) {
            harmonic->target[0] = 0.0F;
            harmonic->target[1] = 0.0F;
            is_more = false;
        } else if (progress->verdict == SPRINGPOT_WORSE) {
            harmonic->target[0] = harmonic->best[0];
            harmonic->target[1] = harmonic->best[1];
        } else {
            /* The share of the way falls where E is not above what noise gives. */
            const float energy = springpot_square(error);
            const float noise = 4.0F * block->variance;
            const float weight = (energy * energy) / ((energy * energy) + (noise * noise));
            const float share = (energy > 0.0F) ? ((harmonic->step_size * progress->caution) * weight) : 0.0F;
            const float re = harmonic->inverse_gain[0];
            const float im = harmonic->inverse_gain[1];
            harmonic->target[0] = harmonic->target[0] - (share * ((re * error[0]) - (im * error[1])));
            harmonic->target[1] = harmonic->target[1] - (share * ((re * error[1]) + (im * error[0])));
            is_more = energy > threshold;
        }
    } else {
        /* another block first */
    }
    return is_more;
}

/* Takes a block that has ended: the mean squares (m^2) of what the harmonics explain of the error, and of its noise, which gives each part
 * of a harmonic the `variance` (m^2). */
static inline void springpot_judge(
    const springpot_learning *learning, springpot_progress *progress, float mean_square, float noise, float variance)
{
    const float parts = learning->noise_parts * variance;
    const float least = progress->least + parts;
    const float alike = learning->growth[0] * least;
    const float total = mean_square + noise;
    const bool is_worse = mean_square > (learning->growth[2] * least);
    float best;

    progress->noise = noise;
    if (progress->is_bare != 0U) {
        const bool settles = total < (learning->settled[0] * progress->without);
        progress->without = total;
        progress->least = mean_square;
        progress->verdict = settles ? SPRINGPOT_SETTLING : SPRINGPOT_BEST;
        if (settles) {
            progress->harm = ((progress->harm > 0.0F) && (total > progress->harm)) ? total : progress->harm;
        } else if (progress->harm > 0.0F) {
            const bool is_film = total > (learning->settled[1] * progress->harm);
            progress->trust = is_film ? 1.0F : (learning->trust[0] * progress->trust);
            progress->trust = (progress->trust < learning->trust[1]) ? 0.0F : progress->trust;
            progress->caution = progress->trust;
            progress->harm = 0.0F;
        } else {
            /* no harm before */
        }
    } else if ((total > (learning->harm * (progress->without + parts))) || (is_worse && (progress->without >= learning->no_error))) {
        /* Of an error that is not known without a correction, one that has grown is enough. */
        progress->taken_over = 0.0F;
        progress->harm = total;
        progress->without = learning->no_error;
        progress->is_bare = 1U;
        progress->verdict = SPRINGPOT_HARMFUL;
    } else {
        float taken = progress->taken_over;
        if ((mean_square > (learning->growth[1] * least)) || (total > progress->without)) {
            taken = taken - (learning->taken + learning->taken);
        } else if (!(mean_square > alike)) {
            taken = taken + learning->taken;
        } else {
            /* neither better nor worse */
        }
        taken = (taken > 1.0F) ? 1.0F : taken;
        progress->taken_over = (taken > 0.0F) ? taken : 0.0F;
        if (is_worse) {
            /* What the film does with the best correction now is measured next. */
            progress->least = learning->no_error;
            progress->verdict = SPRINGPOT_WORSE;
            progress->caution = learning->caution[0] * progress->caution;
        } else {
            const float caution = learning->caution[1] * progress->caution;
            progress->caution = (caution > progress->trust) ? progress->trust : caution;
            progress->verdict = (mean_square > alike) ? SPRINGPOT_GOOD : SPRINGPOT_BEST;
            progress->least = (mean_square > progress->least) ? progress->least : mean_square;
        }
    }
    best = progress->least + noise;
    progress->excess = learning->excess * ((best < progress->without) ? best : progress->without);
}

/* Ends a block. What the harmonics do not explain of the error is noise. */
static inline void springpot_complete_block(const springpot_learning *learning, springpot_learning_state *state)
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
    explained = (block->scale * explained) / block->samples;
    springpot_judge(learning, &state->progress, explained, (block->sum_of_squares / block->samples) - explained, block->variance);
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
                springpot_complete_block(learning, state);
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
        /* So much worse than the best block that this one need not end. */
        if ((!closed) && (block->samples > learning->excess_samples)
            && (block->sum_of_squares > (state->progress.excess * block->samples))) {
            uint32_t i;
            springpot_judge(
                learning, &state->progress, block->sum_of_squares / block->samples, state->progress.noise, 0.0F);
            for (i = 0U; i <= SPRINGPOT_HARMONICS; i++) {
                if (state->progress.verdict == SPRINGPOT_HARMFUL) {
                    springpot_clear_harmonic(learning, &state->harmonics[i]);
                } else {
                    state->harmonics[i].target[0] = state->harmonics[i].best[0];
                    state->harmonics[i].target[1] = state->harmonics[i].best[1];
                }
            }
            springpot_begin_block(learning, state);
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
        const float angle = (float)index * state->angle;
        if ((index <= learning->harmonics) && (angle <= learning->largest_angle)) {
            const bool is_fast = (index > 0U) && (!((angle * learning->rate) < learning->slow));
            if (springpot_update_harmonic(learning, harmonic, &state->block, &state->progress, index == 0U, is_fast)) {
                state->block.is_short = 1U;
            }
        }
        state->progress.is_bare =
            (((index == 0U) || (state->progress.is_bare != 0U)) && (!(springpot_square(harmonic->target) > 0.0F))) ? 1U : 0U;
        if (index == SPRINGPOT_HARMONICS) {
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

