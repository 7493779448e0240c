/* ---- Adaptation: how a film differs from its law, from the force that the observer finds. Off until springpot_tracking_set_adapting. */

/* Parameters: the logarithm of the force scale and of the stiffness of what relaxes, that of all relaxation rates and a factor of their
 * logarithms about 1/s, and a constant force (N). */
#define SPRINGPOT_ADAPTED_SCALE 0U
#define SPRINGPOT_ADAPTED_MEMORY 1U
#define SPRINGPOT_ADAPTED_RATE 2U
#define SPRINGPOT_ADAPTED_STRETCH 3U
#define SPRINGPOT_ADAPTED_BIAS 4U

/* ln (x / y), near a ratio of 1. */
static inline float springpot_log_of_ratio(const springpot_adaptation *adaptation, float x, float y)
{
    const float part = (x - y) / (x + y);
    const float square = part * part;
    return part * (2.0F + (square * (adaptation->logarithm[0] + (adaptation->logarithm[1] * square))));
}

/* e^x. */
static inline float springpot_exp(const springpot_adaptation *adaptation, float x)
{
    const float part = adaptation->exponential[0] * x;
    float power = 1.0F + (part * (1.0F + (part * (0.5F + (part * adaptation->exponential[1])))));
    uint32_t i;
    for (i = 0U; i < 4U; i++) {
        power = power * power;
    }
    return power;
}

/* ln x of the series, so that springpot_exp gives x again. */
static inline float springpot_logarithm(const springpot_adaptation *adaptation, float x)
{
    const float near = springpot_log_of_ratio(adaptation, x, 1.0F);
    return near + springpot_log_of_ratio(adaptation, x, springpot_exp(adaptation, near));
}

/* The film as its law has it; nothing is known of it. */
static inline void springpot_adaptation_init(springpot_adaptation_state *state)
{
    uint32_t i;

    state->is_in_use = 0U;
    state->adapting = SPRINGPOT_ADAPT_OFF;
    state->phase = 0U;
    state->stiffer = 0.0F;
    state->loss_before = 0.0F;
    state->log_before = 0.0F;
    state->is_excited = 0U;
    state->ageing = 0.0F;
    state->misfit = 1.0F;
    state->doubt = 1.0F;
    state->rate = 0.0F;
    for (i = 0U; i < 2U; i++) {
        state->stated[i] = 0.0F;
        state->stated_used[i] = 0.0F;
        state->sums[i] = 0.0F;
        state->steps[i] = 0.0F;
    }
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        state->estimates[i] = 0.0F;
        state->used[i] = 0.0F;
        state->forces[i] = 0.0F;
        state->diagonal[i] = 1.0F;
    }
    for (i = 0U; i < SPRINGPOT_ABOVE; i++) {
        state->upper[i] = 0.0F;
    }
    for (i = 0U; i < (SPRINGPOT_FAST + SPRINGPOT_SLOW); i++) {
        state->slopes[i] = 0.0F;
    }
}

/* Nothing is known of the film; what is in use goes out of use. */
static inline void springpot_adaptation_forget(springpot_adaptation_state *state)
{
    uint32_t i;
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        state->estimates[i] = 0.0F;
        state->diagonal[i] = 1.0F;
    }
    for (i = 0U; i < SPRINGPOT_ABOVE; i++) {
        state->upper[i] = 0.0F;
    }
    state->misfit = 1.0F;
    state->doubt = 1.0F;
    state->ageing = 0.0F;
}

/* Covariance of two estimates, in squares of what is expected, if forces are explained as well as is expected: the entry of U D U'. */
static inline float springpot_covariance(const springpot_adaptation_state *state, uint32_t row, uint32_t column)
{
    float sum = 0.0F;
    uint32_t i;

    for (i = (row > column) ? row : column; i < SPRINGPOT_PARAMETERS; i++) {
        const float *above = &state->upper[(i * (i - ((i > 0U) ? 1U : 0U))) / 2U];
        const float left = (i == row) ? 1.0F : above[row];
        const float right = (i == column) ? 1.0F : above[column];
        sum = sum + ((left * right) * state->diagonal[i]);
    }
    return sum;
}

/* Standard deviation of the force scale, over it. */
static inline float springpot_uncertainty(const springpot_adaptation *adaptation, const springpot_adaptation_state *state)
{
    return sqrtf(state->misfit)
        * (adaptation->parameters[SPRINGPOT_ADAPTED_SCALE].expected * sqrtf(springpot_covariance(state, SPRINGPOT_ADAPTED_SCALE, SPRINGPOT_ADAPTED_SCALE)));
}

/* The largest change, less its part that may be chance, over the one that is an ageing of 1. */
static inline float springpot_aged(const springpot_adaptation *adaptation, const springpot_adaptation_state *state)
{
    const float chance = (adaptation->by_chance * adaptation->by_chance) * state->misfit;
    float aged = 0.0F;
    uint32_t i;

    for (i = 0U; i < SPRINGPOT_ADAPTED_BIAS; i++) {
        const springpot_parameter *parameter = &adaptation->parameters[i];
        const float used = springpot_size(state->used[i]);
        const float by_chance = chance * ((parameter->expected * parameter->expected) * springpot_covariance(state, i, i));
        if ((used * used) > by_chance) {
            const float change = (used - (by_chance / used)) * parameter->aged;
            aged = (change > aged) ? change : aged;
        }
    }
    return aged;
}

/* Where the memory of a film goes on to, after a step. */
typedef struct {
    float force;  /* of the memory, N */
    float value;  /* what it acts on, m */
    float weight; /* of its force */
    float slope;  /* of what it acts on */
    float stiffness; /* of the film within the next step, N/m */
    float steepness; /* of slow changes over that at rest */
} springpot_remembered;

static inline springpot_remembered springpot_remembered_of(const springpot_film *film, const springpot_state *state)
{
    springpot_remembered memory = {0.0F, 0.0F, 1.0F, 1.0F, 0.0F, 1.0F};
    memory.force = state->base;
    if (film->curve == NULL) {
        memory.value = state->position + state->increment;
        memory.stiffness = film->law.stiffness;
    } else {
        memory.value = state->ahead.knot + state->ahead.beyond;
        memory.slope = state->ahead.slope;
        memory.stiffness = state->stiffness;
        memory.steepness = state->slope;
    }
    if (film->spring != NULL) {
        memory.force = state->memory;
        memory.weight = state->ahead.slope;
    } else if (film->series != NULL) {
        const float share = memory.slope / (film->curve->instant + memory.slope);
        memory.force = state->memory;
        memory.value = ((state->position + state->origin) - state->elongation) + state->predicted;
        memory.weight = share;
        memory.slope = share;
    } else {
        /* The memory's force is that of the film. */
    }
    return memory;
}

/* Makes what relaxes of the memory of a film stiffer by what is in use, after a step, which leaves it as its law has it. */
static inline void springpot_stiffen(const springpot_film *film, float stiffer, springpot_state *state)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const springpot_remembered memory = springpot_remembered_of(film, state);
    const float more = stiffer * (memory.force - (adaptation->lasting * memory.value));
    const float stiffness = memory.stiffness + (stiffer * ((memory.weight * memory.slope) * adaptation->relaxing));
    /* A film near pull-in may have no other stiffness. */
    const float least = 0.5F * memory.stiffness;

    state->memory = state->memory + more;
    state->base = state->base + (memory.weight * more);
    state->stiffness = (stiffness > least) ? stiffness : least;
    /* The observer's gains follow. */
    state->slope = memory.steepness + ((stiffer * adaptation->share) * memory.steepness);
}

/* Lets the mode `index` flow faster or slower than its law has it, once in a round for all of the round. */
static inline void springpot_flow(
    const springpot_film *film, springpot_adaptation_state *state, springpot_state *law, uint32_t index)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const bool is_fast = index < SPRINGPOT_FAST;
    const springpot_decay *decay = is_fast ? &film->law.fast[index] : &film->law.slow[index - SPRINGPOT_FAST];
    springpot_dashpot *dashpot = is_fast ? NULL : &law->slow[index - SPRINGPOT_FAST];
    const float extension = is_fast ? law->fast[index] : (law->left - dashpot->displacement);
    const float lost = adaptation->ticks * decay->loss;
    float slope = state->slopes[index];
    float factor;
    float moved;
    float flow;
    float flows;
    float force;

    /* The logarithm grows from mode to mode, and from a rate of 1/s. */
    if (state->phase == 0U) {
        state->loss_before = adaptation->step;
        state->log_before = 0.0F;
    }
    /* Modes that are not used lose nothing. */
    if (decay->loss > 0.0F) {
        state->log_before =
            state->log_before + springpot_log_of_ratio(adaptation, decay->loss, state->loss_before);
        state->loss_before = decay->loss;
    }
    factor = springpot_exp(adaptation, state->rate + (state->used[SPRINGPOT_ADAPTED_STRETCH] * state->log_before));
    /* What has just come into use counts from the beginning: the extension is as if it had always been so. */
    moved = slope * (state->steps[0] + (state->steps[1] * state->log_before));
    flow = (((factor - 1.0F) * lost) * extension) - moved;
    if (is_fast) {
        law->fast[index] = extension - flow;
    } else {
        const float addend = flow - dashpot->surplus;
        const float displacement = dashpot->displacement + addend;
        dashpot->surplus = (displacement - dashpot->displacement) - addend;
        dashpot->displacement = displacement;
    }
    flows = factor * lost;
    slope = (slope - (flows * extension)) / (1.0F + flows);
    force = decay->weight * slope;
    state->slopes[index] = slope;
    state->sums[0] = state->sums[0] + force;
    state->sums[1] = state->sums[1] + (state->log_before * force);
}

/* Brings estimates into use, and finds the forces by which the parameters act now. */
static inline void springpot_bring_into_use(
    const springpot_film *film, springpot_adaptation_state *state, springpot_observer_state *observed)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const springpot_load *acts = &observed->load;
    const float load = observed->force_scale
        * ((acts->force - film->drive.preload) + (acts->slope * observed->film.position));
    /* Of a film that has just been stiffened. */
    const springpot_remembered memory = springpot_remembered_of(film, &observed->film);
    const float weight = (1.0F + state->stiffer) * memory.weight;
    const float relaxing = memory.weight * (memory.force - (adaptation->lasting * memory.value));
    float changes[SPRINGPOT_PARAMETERS];
    const springpot_parameter *scales = &adaptation->parameters[SPRINGPOT_ADAPTED_SCALE];
    const springpot_parameter *rates = &adaptation->parameters[SPRINGPOT_ADAPTED_RATE];
    float warmed[2];
    float shift = 0.0F;
    float scale;
    float rate;
    float variance;
    bool forgotten = state->adapting == SPRINGPOT_ADAPT_OFF;
    uint32_t i;

    state->forces[SPRINGPOT_ADAPTED_SCALE] = load;
    state->forces[SPRINGPOT_ADAPTED_MEMORY] = -((adaptation->share > 0.0F) ? relaxing : 0.0F);
    state->forces[SPRINGPOT_ADAPTED_RATE] = -(weight * state->sums[0]);
    state->forces[SPRINGPOT_ADAPTED_STRETCH] = -(weight * state->sums[1]);
    state->forces[SPRINGPOT_ADAPTED_BIAS] = 1.0F;
    state->sums[0] = 0.0F;
    state->sums[1] = 0.0F;
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        changes[i] = adaptation->blend * (state->estimates[i] - state->used[i]);
        state->used[i] = state->used[i] + changes[i];
        if (!(springpot_size(state->used[i]) <= (adaptation->forgotten * adaptation->parameters[i].expected))) {
            forgotten = false;
        }
    }
    /* The film itself changes with its temperature: there is no shift of the force, and what flowed before stays. */
    for (i = 0U; i < 2U; i++) {
        const uint32_t of = (i == 0U) ? SPRINGPOT_ADAPTED_SCALE : SPRINGPOT_ADAPTED_RATE;
        warmed[i] = adaptation->blend * (state->stated[i] - state->stated_used[i]);
        state->stated_used[i] = state->stated_used[i] + warmed[i];
        if (!(springpot_size(state->stated_used[i]) <= (adaptation->forgotten * adaptation->parameters[of].expected))) {
            forgotten = false;
        }
    }
    if (forgotten) {
        state->stated_used[0] = 0.0F;
        state->stated_used[1] = 0.0F;
        for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
            changes[i] = changes[i] - state->used[i];
            state->used[i] = 0.0F;
        }
        /* The next round leaves the stiffness of the film as its law has it. */
        state->is_in_use = (springpot_size(state->stiffer) > 0.0F) ? 1U : 0U;
    }
    /* The total force stays the same at this moment. The bias is a part of the disturbance. The force scale may be another one where this
     * begins. */
    scale = state->used[SPRINGPOT_ADAPTED_SCALE] + state->stated_used[0];
    scale = springpot_exp(adaptation, springpot_clamp(scale, -scales->restored, scales->restored));
    changes[SPRINGPOT_ADAPTED_SCALE] = ((scale / observed->force_scale) - 1.0F) - warmed[0];
    changes[SPRINGPOT_ADAPTED_BIAS] = 0.0F;
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        shift = shift + (changes[i] * state->forces[i]);
    }
    state->steps[0] = changes[SPRINGPOT_ADAPTED_RATE];
    state->steps[1] = changes[SPRINGPOT_ADAPTED_STRETCH];
    rate = state->used[SPRINGPOT_ADAPTED_RATE] + state->stated_used[1];
    state->rate = springpot_clamp(rate, -rates->restored, rates->restored);
    observed->force_scale = scale;
    observed->integral = observed->integral - shift;
    observed->disturbance = observed->disturbance - shift;
    observed->integral_mean = state->used[SPRINGPOT_ADAPTED_BIAS];
    state->stiffer = springpot_exp(adaptation, state->used[SPRINGPOT_ADAPTED_MEMORY]) - 1.0F;
    /* What is not seen changes as well. */
    variance = state->diagonal[SPRINGPOT_ADAPTED_SCALE] + adaptation->wandering;
    state->diagonal[SPRINGPOT_ADAPTED_SCALE] = (variance > 1.0F) ? 1.0F : variance;
    state->is_excited = (springpot_size(load - observed->load_mean) > adaptation->excited) ? 1U : 0U;
}

/* Learns from an unexplained force (N): recursive least squares in Bierman's form, whose covariance stays positive in single precision. */
static inline void springpot_learn(
    const springpot_adaptation *adaptation, springpot_adaptation_state *state, float unexplained)
{
    const springpot_parameter *parameters = adaptation->parameters;
    float *column = state->upper;
    float regressors[SPRINGPOT_PARAMETERS];
    float gains[SPRINGPOT_PARAMETERS];
    float moved = springpot_size(state->steps[0]) + springpot_size(state->steps[1]);
    float open = unexplained;
    float innovation;
    float total = 1.0F;
    float part = 1.0F;
    float step;
    uint32_t i;
    uint32_t j;

    if (state->is_excited == 0U) {
        /* A load that stays distinguishes nothing. */
        state->estimates[SPRINGPOT_ADAPTED_BIAS] = state->estimates[SPRINGPOT_ADAPTED_BIAS]
            + (adaptation->averaging * (unexplained - state->estimates[SPRINGPOT_ADAPTED_BIAS]));
        return;
    }
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        /* The disturbance has all of the bias. */
        const float used = (i == SPRINGPOT_ADAPTED_BIAS) ? 0.0F : state->used[i];
        open = open - ((state->estimates[i] - used) * state->forces[i]);
        regressors[i] = (state->forces[i] * adaptation->precision) * parameters[i].expected;
    }
    innovation = open * adaptation->precision;
    if (!springpot_is_finite(innovation)) {
        return;
    }
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        const float before = total;
        float along = regressors[i];
        float spread;
        float back;
        for (j = 0U; j < i; j++) {
            along = along + (column[j] * regressors[j]);
        }
        spread = state->diagonal[i] * along;
        total = total + (along * spread);
        state->diagonal[i] = state->diagonal[i] * (before / total);
        back = -(along / before);
        for (j = 0U; j < i; j++) {
            const float entry = column[j];
            column[j] = entry + (gains[j] * back);
            gains[j] = gains[j] + (entry * spread);
        }
        gains[i] = spread;
        column += i;
    }
    /* What is less plausible counts less. */
    step = innovation / (total * (1.0F + ((innovation * innovation) / (adaptation->plausible * total))));
    state->misfit = state->misfit + (adaptation->averaging * ((innovation * step) - state->misfit));
    /* Only as far as all of them stay within their bounds: held there one by one, the others would run away. */
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        const float by = (gains[i] * step) * parameters[i].expected;
        const float bound = parameters[i].bound;
        const float room = (by > 0.0F) ? (bound - state->estimates[i]) : (bound + state->estimates[i]);
        const float most = (springpot_size(by) > room) ? (room / springpot_size(by)) : 1.0F;
        part = springpot_clamp(most, 0.0F, part);
        moved = (springpot_size(state->estimates[i]) > (adaptation->described * bound)) ? 0.0F : moved;
        gains[i] = by;
    }
    for (i = 0U; i < SPRINGPOT_PARAMETERS; i++) {
        const springpot_parameter *parameter = &parameters[i];
        const float growth = parameter->forgetting + (parameter->relinearising * moved);
        const float variance = state->diagonal[i] + (growth * state->diagonal[i]);
        state->estimates[i]
            = springpot_clamp(state->estimates[i] + (part * gains[i]), -parameter->bound, parameter->bound);
        state->diagonal[i] = (variance > 1.0F) ? 1.0F : variance;
    }
    /* It counts until something is learned again, although nothing is known of what changes meanwhile. */
    state->doubt = state->misfit * springpot_covariance(state, SPRINGPOT_ADAPTED_SCALE, SPRINGPOT_ADAPTED_SCALE);
    state->ageing = springpot_aged(adaptation, state);
}

/* A tick of a film that changes, after that of the observer. Work is spread over rounds of some thirty ticks: in each tick a mode, in the
 * last two what was estimated comes into use, and the next estimate is made. `limited`: limits that the last command met. */
static SPRINGPOT_NOT_INLINED void springpot_adaptation_advance(const springpot_film *film,
    springpot_adaptation_state *SPRINGPOT_RESTRICT state, springpot_observer_state *SPRINGPOT_RESTRICT observed, uint32_t limited)
{
    const springpot_adaptation *adaptation = &film->adaptation;
    const uint32_t phase = state->phase;

    springpot_stiffen(film, state->stiffer, &observed->film);
    if (phase < adaptation->count) {
        springpot_flow(film, state, &observed->film, adaptation->first + phase);
    } else if (phase == adaptation->count) {
        springpot_bring_into_use(film, state, observed);
    } else {
        const bool is_corrected =
            (observed->since_sample <= film->observer.lost_after) && (observed->share > film->observer.full_share);
        /* Shaping changes the reference, not the command. */
        const bool is_limited = (limited & ~(SPRINGPOT_VELOCITY | SPRINGPOT_ACCELERATION)) != 0U;
        if ((state->adapting == SPRINGPOT_ADAPT_LEARN) && is_corrected && !is_limited) {
            springpot_learn(adaptation, state,
                observed->disturbance + ((adaptation->stiffness * observed->film.slope) * observed->innovation));
        }
    }
    state->phase = (phase > adaptation->count) ? 0U : (phase + 1U);
}

