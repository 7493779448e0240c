/* ---- Learning: the opposite of what is left of the error in every cycle is added to a periodic reference. For a film whose
 * `learning` is not NULL; with others the reference passes as it is. */

/* Turning points and crossings of a reference. */
typedef struct {
    float previous; /* m */
    float extreme;  /* m */
    float upper;    /* m */
    float lower;    /* m */
    float swing;    /* m */
    float ticks_since_crossing;
    float interval; /* ticks */
    uint32_t is_rising;
    uint32_t is_armed;
    uint32_t is_periodic;
} springpot_cycle;

/* A harmonic of the error, complex amplitudes in m. */
typedef struct {
    float added[2];
    float target[2];
    float previous_target[2];
    float best[2];
    float sum[2];
    float error[2];
    float inverse_gain[2];
    float drift; /* m^2 */
    float step_size;
    uint32_t unresponsive_blocks;
} springpot_harmonic;

/* The cycles over which harmonics are measured. */
typedef struct {
    float ticks;
    float ticks_since_end;
    float angle;    /* rad */
    float next_end; /* rad */
    float samples;
    float sum_of_squares; /* m^2 */
    float scale;
    float variance; /* m^2 */
    uint32_t has_ended;
    uint32_t is_short;
} springpot_block;

/* What the blocks of a period have shown. */
typedef struct {
    float least; /* m^2 */
    float noise; /* m^2 */
    float caution;
    float taken_over; /* share of the correction of the sensor, 0 to 1 */
    float without;    /* m^2 */
    float harm;       /* m^2 */
    float trust;
    float excess; /* m^2 */
    uint32_t is_bare;
    uint32_t verdict;
} springpot_progress;

#define SPRINGPOT_BEST 0U
#define SPRINGPOT_GOOD 1U
#define SPRINGPOT_WORSE 2U
#define SPRINGPOT_HARMFUL 3U
#define SPRINGPOT_SETTLING 4U

/* A reference and its phase. */
typedef struct {
    float reference; /* m */
    float phase[2];
} springpot_turn;

/* For reading: lagged[1] is what is added to the reference now (m), angle what a tick turns (rad; 0 without a period),
 * progress.taken_over the share of the correction of the sensor that learning has taken over. */
typedef struct {
    springpot_cycle cycle;
    float phase[2];
    float rotation[2];
    float angle; /* rad */
    float fade;
    float lagged[2]; /* m */
    springpot_harmonic harmonics[SPRINGPOT_HARMONICS + 1U];
    uint32_t has_arrived;
    float arrived;        /* m */
    uint32_t arrived_at;
    uint32_t index;
    float error; /* m */
    float unit[2];
    float power[2];
    springpot_block block;
    springpot_progress progress;
    uint32_t newest;
    springpot_turn past[SPRINGPOT_PAST];
} springpot_learning_state;

SPRINGPOT_ASSERT(sizeof(springpot_learning_state) == 1436U, a_state_of_learning_takes_1436_bytes);

/* `angle` (rad) within its bound, and exp(i) of it. */
static inline void springpot_set_angle(const springpot_learning *learning, springpot_learning_state *state, float angle)
{
    const float bounded = (angle < learning->series_angle) ? angle : learning->series_angle;
    const float square = bounded * bounded;
    const float *a = learning->cosine;
    const float *b = learning->sine;
    state->angle = bounded;
    state->rotation[0] = a[0] + (square * (a[1] + (square * (a[2] + (square * a[3])))));
    state->rotation[1] = bounded * (b[0] + (square * (b[1] + (square * (b[2] + (square * b[3]))))));
}

/* Begins a block, as rough as the one before. */
static inline void springpot_begin_block(const springpot_learning *learning, springpot_learning_state *state)
{
    uint32_t i;
    state->block.ticks = 0.0F;
    state->block.angle = 0.0F;
    state->block.next_end = (learning != NULL) ? learning->turn : 0.0F;
    state->block.samples = 0.0F;
    state->block.sum_of_squares = 0.0F;
    state->block.scale = 0.0F;
    state->block.variance = 0.0F;
    state->block.has_ended = 0U;
    for (i = 0U; i <= SPRINGPOT_HARMONICS; i++) {
        state->harmonics[i].sum[0] = 0.0F;
        state->harmonics[i].sum[1] = 0.0F;
    }
}

/* No block has ended, with the correction of before. */
static inline void springpot_renew_blocks(const springpot_learning *learning, springpot_progress *progress)
{
    const float no_error = (learning != NULL) ? learning->no_error : 0.0F;
    progress->least = no_error;
    progress->noise = 0.0F;
    progress->without = (progress->is_bare != 0U) ? 0.0F : no_error;
    progress->harm = 0.0F;
    progress->excess = no_error;
    progress->verdict = SPRINGPOT_BEST;
}

/* The same for another period. */
static inline void springpot_renew_progress(const springpot_learning *learning, springpot_progress *progress)
{
    progress->caution = 1.0F;
    progress->trust = 1.0F;
    progress->taken_over = 0.0F;
    springpot_renew_blocks(learning, progress);
}

/* No correction, for a film that responds as its law predicts. What is added stays. */
static inline void springpot_clear_harmonic(const springpot_learning *learning, springpot_harmonic *harmonic)
{
    uint32_t part;

    for (part = 0U; part < 2U; part++) {
        harmonic->target[part] = 0.0F;
        harmonic->previous_target[part] = 0.0F;
        harmonic->best[part] = 0.0F;
        harmonic->error[part] = 0.0F;
    }
    harmonic->inverse_gain[0] = 1.0F;
    harmonic->inverse_gain[1] = 0.0F;
    harmonic->drift = (learning != NULL) ? learning->drift_unknown[0] : 0.0F;
    harmonic->step_size = (learning != NULL) ? learning->probing_step_size : 0.0F;
    harmonic->unresponsive_blocks = 0U;
}

/* Forgets what was learned. What is added fades out. */
static inline void springpot_learning_forget(const springpot_film *film, springpot_learning_state *state)
{
    uint32_t i;

    for (i = 0U; i <= SPRINGPOT_HARMONICS; i++) {
        state->harmonics[i].added[0] = 0.0F;
        state->harmonics[i].added[1] = 0.0F;
        springpot_clear_harmonic(film->learning, &state->harmonics[i]);
    }
    springpot_begin_block(film->learning, state);
    state->block.ticks_since_end = 0.0F;
    state->block.is_short = 1U;
    state->progress.is_bare = 1U;
    springpot_renew_progress(film->learning, &state->progress);
    state->index = 0U;
}

/* Begins another run, whose reference begins at `position` (m), with what was learned if it `keeps` it. The sample that has arrived last
 * stays. */
static inline void springpot_learning_restart(
    const springpot_film *film, springpot_learning_state *state, float position, bool keeps)
{
    const springpot_learning *learning = film->learning;
    const bool given = (learning != NULL) && (learning->period > 0.0F);
    uint32_t i;

    if (!keeps) {
        springpot_learning_forget(film, state);
    }
    state->cycle.previous = position;
    state->cycle.extreme = position;
    state->cycle.upper = position;
    state->cycle.lower = position;
    state->cycle.swing = 0.0F;
    state->cycle.ticks_since_crossing = 0.0F;
    state->cycle.interval = 0.0F;
    state->cycle.is_rising = 1U;
    state->cycle.is_armed = 0U;
    state->cycle.is_periodic = 0U;
    state->phase[0] = 1.0F;
    state->phase[1] = 0.0F;
    state->angle = 0.0F;
    state->rotation[0] = 1.0F;
    state->rotation[1] = 0.0F;
    if (given) {
        springpot_set_angle(learning, state, learning->turn / learning->period);
    }
    state->fade = given ? 1.0F : 0.0F;
    state->lagged[0] = 0.0F;
    state->lagged[1] = 0.0F;
    for (i = 0U; i <= SPRINGPOT_HARMONICS; i++) {
        springpot_harmonic *harmonic = &state->harmonics[i];
        harmonic->added[0] = 0.0F;
        harmonic->added[1] = 0.0F;
        /* Nothing has changed against the block before: the film's answer stays as it was measured. */
        harmonic->previous_target[0] = harmonic->target[0];
        harmonic->previous_target[1] = harmonic->target[1];
    }
    for (i = 0U; i < SPRINGPOT_PAST; i++) {
        state->past[i].reference = position;
        state->past[i].phase[0] = 1.0F;
        state->past[i].phase[1] = 0.0F;
    }
    /* The ring begins at 0 again. */
    state->arrived_at = (state->arrived_at + (SPRINGPOT_PAST - state->newest)) % SPRINGPOT_PAST;
    state->newest = 0U;
    state->index = 0U;
    state->error = 0.0F;
    state->unit[0] = 1.0F;
    state->unit[1] = 0.0F;
    state->power[0] = 1.0F;
    state->power[1] = 0.0F;
    springpot_begin_block(learning, state);
    state->block.ticks_since_end = 0.0F;
    state->block.is_short = 1U;
    springpot_renew_blocks(learning, &state->progress);
}

/* Nothing learned yet, of a reference that begins at `position` (m). */
static inline void springpot_learning_init(const springpot_film *film, springpot_learning_state *state, float position)
{
    state->newest = 0U;
    state->has_arrived = 0U;
    state->arrived = 0.0F;
    state->arrived_at = 0U;
    springpot_learning_restart(film, state, position, false);
}

static inline float springpot_square(const float *pair)
{
    return (pair[0] * pair[0]) + (pair[1] * pair[1]);
}

/* Takes the next reference (m). Whether it crossed its middle upwards in this tick; `late`: how many ticks ago, 0 to 1. */
static inline bool springpot_find_cycle(
    const springpot_learning *learning, springpot_cycle *cycle, float reference, float *late)
{
    const float previous = cycle->previous;
    const bool is_rising = cycle->is_rising != 0U;
    float hysteresis;
    float reversal;
    float middle;
    bool crossed;

    cycle->swing = cycle->swing - (learning->swing_decay * cycle->swing);
    hysteresis = learning->hysteresis * cycle->swing;
    hysteresis = (hysteresis > learning->min_swing) ? hysteresis : learning->min_swing;
    if (is_rising ? (reference > cycle->extreme) : (reference < cycle->extreme)) {
        cycle->extreme = reference;
    }
    reversal = is_rising ? (cycle->extreme - reference) : (reference - cycle->extreme);
    if (reversal > hysteresis) {
        if (is_rising) {
            cycle->upper = cycle->extreme;
        } else {
            cycle->lower = cycle->extreme;
            cycle->is_armed = 1U;
        }
        cycle->swing = cycle->upper - cycle->lower;
        cycle->is_rising = is_rising ? 0U : 1U;
        cycle->extreme = reference;
    }
    cycle->previous = reference;
    cycle->ticks_since_crossing = cycle->ticks_since_crossing + 1.0F;
    if (cycle->ticks_since_crossing > (learning->overdue * cycle->interval)) {
        cycle->is_periodic = 0U;
    }
    middle = 0.5F * (cycle->upper + cycle->lower);
    crossed = (cycle->is_armed != 0U) && (previous < middle) && (reference >= middle);
    if (crossed) {
        const float ticks_ago = (reference - middle) / (reference - previous);
        const float interval = cycle->ticks_since_crossing - ticks_ago;
        const float difference = interval - cycle->interval;
        const float tolerance = learning->agreement * interval;
        cycle->is_armed = 0U;
        cycle->is_periodic = ((difference < tolerance) && (-difference < tolerance)) ? 1U : 0U;
        cycle->interval = interval;
        cycle->ticks_since_crossing = ticks_ago;
        *late = ticks_ago;
    }
    return crossed;
}

/* Takes the period from the reference. */
static inline void springpot_track_period(
    const springpot_learning *learning, springpot_learning_state *state, float reference)
{
    float late = 0.0F;
    const bool crossed = springpot_find_cycle(learning, &state->cycle, reference, &late);

    if (state->cycle.is_periodic == 0U) {
        state->angle = 0.0F;
        springpot_renew_progress(learning, &state->progress);
    } else if (crossed) {
        const float angle = learning->turn / state->cycle.interval;
        const float cosine = state->phase[0];
        /* The crossing is where the phase is 0: `late` ticks ago. */
        const float phase_error = state->phase[1] - ((angle * late) * cosine);
        if ((state->angle > 0.0F) && (cosine > 0.0F) && (phase_error < learning->same_period)
            && (-phase_error < learning->same_period)) {
            /* The next cycle makes up for what is left. */
            springpot_set_angle(learning, state, angle - ((angle * phase_error) / learning->turn));
        } else if (state->fade > learning->faded_out) {
            /* Another period: what was learned is faded out first. */
            state->angle = 0.0F;
            springpot_renew_progress(learning, &state->progress);
        } else {
            state->phase[0] = 1.0F;
            state->phase[1] = angle * late;
            springpot_set_angle(learning, state, angle);
            springpot_begin_block(learning, state);
        }
    } else {
        /* nothing new */
    }
}

