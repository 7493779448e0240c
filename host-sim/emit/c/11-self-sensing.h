
/* ---- The film as its own displacement sensor: a tone on the drive, the current that it causes, the capacitance, the displacement. In every
 * tick springpot_self_sensing_sense with the readings of the last one, then springpot_self_sensing_drive for the voltage of the next. */

/* Why a film cannot be sensed, as two blocks in a row have shown: `fault`, which is 0 before. It stays: end at 0 V. */
#define SPRINGPOT_NO_TONE 1U         /* in the voltage: the amplifier does not pass it, or is off */
#define SPRINGPOT_SHORTED 2U         /* the film conducts */
#define SPRINGPOT_CURRENT_MONITOR 3U /* no tone in the current, less than the cable alone would have */
#define SPRINGPOT_ELECTRODE 4U       /* less than half of the film's capacitance, or behind too much resistance */

/* The demodulation of a signal. */
typedef struct {
    float stages[3][2]; /* the last two values before each difference */
    float sums[2];
} springpot_demodulator;

/* The springpot of the relation. */
typedef struct {
    float position; /* m */
    float increment;
    float base;
    uint32_t newest; /* of the increments below */
    float increments[2U * SPRINGPOT_CREEP_HEAD]; /* the last ones, twice */
    float modes[SPRINGPOT_CREEP_MODES];
} springpot_creep_state;

/* For reading: fault, and of the last block that gave a sample capacitance (F, of film and cable) and apparent series resistance (Ohm); drive,
 * the voltage without the tone half a period ago (V), with which a model of the film steps; offset, the displacement by another sensor
 * minus that by the capacitance (m). */
typedef struct {
    springpot_creep_state creep;
    springpot_demodulator voltage;
    springpot_demodulator current;
    float current_sum; /* in this block, A */
    uint32_t tick;     /* of the block */
    uint32_t settling;
    uint32_t faulty;  /* blocks in a row, as far as they are counted */
    uint32_t fault;
    uint32_t is_good; /* 1: the last block gave a sample */
    float tone[2];    /* mean of the voltage's phasor */
    float weight;     /* of the last block in that */
    uint32_t others;  /* blocks in a row with another tone */
    float capacitance;
    float resistance;
    float relative; /* variance of the capacitance, relative */
    float drive;
    float past[SPRINGPOT_BLOCKS]; /* estimates without the offset, m */
    uint32_t newest;              /* of them */
    float offset;
    float variance; /* of the offset, m^2 */
    uint32_t is_pending;       /* 1: a sample of another sensor waits for an estimate of its time */
    springpot_sample pending;  /* its age once the next estimate is made */
    float pending_variance;    /* m^2 */
    springpot_sample sample;   /* the last one */
    float sample_variance;     /* m^2 */
} springpot_self_sensing_state;

SPRINGPOT_ASSERT(sizeof(springpot_self_sensing_state) == 284U, a_state_of_self_sensing_takes_284_bytes);

static inline void springpot_demodulator_init(springpot_demodulator *state)
{
    uint32_t i;

    for (i = 0U; i < 3U; i++) {
        state->stages[i][0] = 0.0F;
        state->stages[i][1] = 0.0F;
    }
    state->sums[0] = 0.0F;
    state->sums[1] = 0.0F;
}

/* A film that has rested at x = 0, at the first tick of the tone: at the start, and to begin anew after a fault. */
static inline void springpot_self_sensing_init(const springpot_self_sensing *sensing, springpot_self_sensing_state *state)
{
    uint32_t i;

    state->creep.position = 0.0F;
    state->creep.increment = 0.0F;
    state->creep.base = 0.0F;
    state->creep.newest = 0U;
    for (i = 0U; i < (2U * SPRINGPOT_CREEP_HEAD); i++) {
        state->creep.increments[i] = 0.0F;
    }
    for (i = 0U; i < SPRINGPOT_CREEP_MODES; i++) {
        state->creep.modes[i] = 0.0F;
    }
    springpot_demodulator_init(&state->voltage);
    springpot_demodulator_init(&state->current);
    state->current_sum = 0.0F;
    state->tick = 0U;
    state->settling = sensing->settling;
    state->faulty = 0U;
    state->fault = 0U;
    state->is_good = 0U;
    state->tone[0] = 0.0F;
    state->tone[1] = 0.0F;
    state->weight = 1.0F;
    state->others = sensing->others;
    state->capacitance = sensing->rest;
    state->resistance = 0.0F;
    state->relative = 0.0F;
    state->drive = 0.0F;
    for (i = 0U; i < SPRINGPOT_BLOCKS; i++) {
        state->past[i] = 0.0F;
    }
    state->newest = 0U;
    state->offset = 0.0F;
    state->variance = sensing->variance;
    state->is_pending = 0U;
    state->pending.displacement = 0.0F;
    state->pending.age_ticks = 0U;
    state->pending_variance = 0.0F;
    state->sample.displacement = 0.0F;
    state->sample.age_ticks = 0U;
    state->sample_variance = 0.0F;
}

/* The voltage of this tick with the tone, V: from 0 V, as a drive below the tone's amplitude is that amplitude, to one amplitude above
 * `voltage_v` (V). */
static inline float springpot_self_sensing_drive(
    const springpot_self_sensing *sensing, const springpot_self_sensing_state *state, float voltage_v)
{
    const uint32_t turn = state->tick & 3U;
    float voltage = (voltage_v > sensing->tone) ? voltage_v : sensing->tone;

    if (turn == 1U) {
        voltage = voltage + sensing->tone;
    } else if (turn == 3U) {
        voltage = voltage - sensing->tone;
    } else {
        /* the tone is 0 V */
    }
    return voltage;
}

/* Takes the next value of a signal. Returns it without the tone. */
static inline float springpot_demodulate(springpot_demodulator *state, float value)
{
    const float without = 0.5F * (value + state->stages[0][0]);
    const float imaginary = state->sums[1];
    float difference = value;
    uint32_t i;

    SPRINGPOT_UNROLL
    for (i = 0U; i < 3U; i++) {
        const float earlier = state->stages[i][0];
        state->stages[i][0] = state->stages[i][1];
        state->stages[i][1] = difference;
        difference = difference - earlier;
    }
    state->sums[1] = difference - state->sums[0];
    state->sums[0] = imaginary;
    return without;
}

/* Sets `phasor` to the sum since the last call, from which the next begins. */
static inline void springpot_take_phasor(springpot_demodulator *state, float *phasor)
{
    phasor[0] = state->sums[1];
    phasor[1] = state->sums[0];
    state->sums[0] = 0.0F;
    state->sums[1] = 0.0F;
}

/* The part of the current across the voltage, times the voltage. */
static inline float springpot_across(const float *voltage, const float *current)
{
    return (voltage[0] * current[1]) - (voltage[1] * current[0]);
}

/* The part along it. */
static inline float springpot_along(const float *voltage, const float *current)
{
    return (voltage[0] * current[0]) + (voltage[1] * current[1]);
}

/* The fault of a block with these phasors, of which the current's sum is `mean`; 0 without one. */
static inline uint32_t springpot_film_fault(
    const springpot_self_sensing *sensing, const float *voltage, const float *current, float mean)
{
    const float voltage2 = springpot_square(voltage);
    const float current2 = springpot_square(current);
    const float across = springpot_across(voltage, current);
    const float along = springpot_along(voltage, current);
    const float capacitance = sensing->capacitance * current2;
    /* Behind steps a resistor is half a capacitance. */
    const bool conducts = ((along > across) || (capacitance > (sensing->max_capacitance * across)))
        && (current2 > (sensing->rest_admittance * voltage2));
    uint32_t fault = 0U;

    if (voltage2 < sensing->min_voltage) {
        fault = (mean > sensing->max_current) ? SPRINGPOT_SHORTED : SPRINGPOT_NO_TONE;
    } else if (current2 < (sensing->min_admittance * voltage2)) {
        fault = SPRINGPOT_CURRENT_MONITOR;
    } else if ((mean > sensing->max_current) || conducts) {
        fault = SPRINGPOT_SHORTED;
    } else if ((along > across) || !(capacitance > (sensing->min_capacitance * across))) {
        fault = SPRINGPOT_ELECTRODE;
    } else {
        /* none */
    }
    return fault;
}

/* Compares the voltage of a block with the tone of those before, whose mean follows it. Whether it is that. */
static inline bool springpot_is_tone(
    const springpot_self_sensing *sensing, springpot_self_sensing_state *state, const float *voltage)
{
    const float off[2] = {voltage[0] - state->tone[0], voltage[1] - state->tone[1]};
    const bool is_another = springpot_square(off) > (sensing->another * sensing->voltage_noise);
    bool is_tone = false;

    if (is_another && (state->others < sensing->others)) {
        state->others = state->others + 1U;
    } else {
        const float next = state->weight / (1.0F + state->weight);
        /* The current's filter reaches a tick further than the voltage's. */
        is_tone = (state->others == 0U) || is_another;
        state->others = 0U;
        state->weight = is_another ? 1.0F : ((next > sensing->least_weight) ? next : sensing->least_weight);
        state->tone[0] = state->tone[0] + (state->weight * off[0]);
        state->tone[1] = state->tone[1] + (state->weight * off[1]);
    }
    return is_tone;
}

/* The impedance of a block, and its faults. */
static SPRINGPOT_NOT_INLINED void springpot_self_sensing_end_block(
    const springpot_self_sensing *sensing, springpot_self_sensing_state *state)
{
    const float mean = fabsf(state->current_sum);
    float voltage[2];
    float sums[2];
    float current[2];
    uint32_t fault;

    springpot_take_phasor(&state->voltage, voltage);
    springpot_take_phasor(&state->current, sums);
    current[0] = sums[0] - sums[1];
    current[1] = sums[0] + sums[1];
    state->current_sum = 0.0F;
    if (state->settling != 0U) {
        state->settling = state->settling - 1U;
        return;
    }
    fault = springpot_film_fault(sensing, voltage, current, mean);
    state->faulty = (fault == 0U) ? 0U : (state->faulty + ((state->faulty < sensing->faulty) ? 1U : 0U));
    if ((state->faulty >= sensing->faulty) && (state->fault == 0U)) {
        state->fault = fault;
    }
    state->is_good = ((fault == 0U) && springpot_is_tone(sensing, state, voltage)) ? 1U : 0U;
    if (state->is_good != 0U) {
        const float current2 = springpot_square(current);
        const float left = state->weight / (2.0F - state->weight);
        state->capacitance = (sensing->capacitance * current2) / springpot_across(state->tone, current);
        state->resistance = (sensing->resistance * springpot_along(state->tone, current)) / current2;
        state->relative =
            (sensing->current_noise / current2) + ((left * sensing->voltage_noise) / springpot_square(state->tone));
    }
}

/* Force of the relation's springpot at `displacement` (m). */
static inline float springpot_creep_force(const springpot_self_sensing *sensing, springpot_creep_state *state, float displacement)
{
    const uint32_t last = SPRINGPOT_CREEP_HEAD - 1U;
    const uint32_t before = state->newest - 1U;
    const uint32_t newest = (before < last) ? before : last;
    float *recent = &state->increments[newest];
    const float oldest = recent[0];
    const float increment = displacement - state->position;
    const float force = state->base + (sensing->creep_stiffness * (increment - state->increment));

    state->newest = newest;
    recent[0] = increment;
    recent[SPRINGPOT_CREEP_HEAD] = increment;
    state->position = displacement;
    state->increment = increment;
    state->base = springpot_of_modes(sensing->creep_modes, state->modes, SPRINGPOT_CREEP_MODES, oldest)
        + springpot_of_head(sensing->creep_head, recent, SPRINGPOT_CREEP_HEAD);
    return force;
}

/* The displacement by the last capacitance without the offset, m, and in `noise` its variance by the noise of that, m^2. */
static inline float springpot_displacement_of_capacitance(
    const springpot_self_sensing *sensing, springpot_self_sensing_state *state, float *noise)
{
    const float *a = sensing->stroke;
    const float change =
        springpot_clamp((state->capacitance * sensing->per_rest) - 1.0F, sensing->changes[0], sensing->changes[1]);
    const float straight = change * (a[0] + (change * (a[1] + (change * a[2]))));
    const float steepness = a[0] + (change * (sensing->slope[0] + (sensing->slope[1] * change)));
    const float slope = (sensing->instant * steepness) * (1.0F + change);

    *noise = (slope * slope) * state->relative;
    return straight + (sensing->creep * springpot_creep_force(sensing, &state->creep, straight));
}

/* Corrects the offset with the sample of another sensor, from between two of the kept estimates. */
static inline void springpot_compare(
    const springpot_self_sensing *sensing, springpot_self_sensing_state *state, float noise)
{
    if (state->pending.age_ticks < sensing->age) {
        /* Younger than the newest estimate: the next will do. */
        state->pending.age_ticks = state->pending.age_ticks + sensing->ticks;
    } else {
        const uint32_t since = state->pending.age_ticks - sensing->age;
        const uint32_t blocks = since / sensing->ticks;
        state->is_pending = 0U;
        if ((blocks < (SPRINGPOT_BLOCKS - 1U)) && (state->is_good != 0U)) {
            const float part = (float)(since % sensing->ticks) / (float)sensing->ticks;
            const float later = state->past[(state->newest + blocks) % SPRINGPOT_BLOCKS];
            const float earlier = state->past[(state->newest + (blocks + 1U)) % SPRINGPOT_BLOCKS];
            const float estimate = later + (part * (earlier - later));
            const float gain = state->variance / ((state->variance + state->pending_variance) + noise);
            state->offset = state->offset + (gain * ((state->pending.displacement - estimate) - state->offset));
            state->variance = state->variance - (gain * state->variance);
        }
    }
}

/* The displacement of the last block; NULL if that was faulty: the relation creeps on with the capacitance before it. */
static SPRINGPOT_NOT_INLINED const springpot_sample *springpot_self_sensing_estimate(
    const springpot_self_sensing *sensing, springpot_self_sensing_state *state)
{
    const springpot_sample *sample = NULL;
    float noise;
    const float displacement = springpot_displacement_of_capacitance(sensing, state, &noise);

    state->newest = (state->newest + (SPRINGPOT_BLOCKS - 1U)) % SPRINGPOT_BLOCKS;
    state->past[state->newest] = displacement;
    state->variance = state->variance + (sensing->drift * (sensing->variance - state->variance));
    if (state->is_pending != 0U) {
        springpot_compare(sensing, state, noise);
    }
    if (state->is_good != 0U) {
        state->sample.displacement = displacement + state->offset;
        state->sample.age_ticks = sensing->age;
        state->sample_variance = state->variance + noise;
        sample = &state->sample;
    }
    return sample;
}

/* Takes the monitored voltage (V) at the end of the tick that has ended, and the mean current (A) into cable and film over it; what is not
 * finite counts as the reading before. Returns a sample with the tick after each block, unless that was faulty, and NULL otherwise. */
static inline const springpot_sample *springpot_self_sensing_sense(
    const springpot_self_sensing *sensing, springpot_self_sensing_state *state, float voltage_v, float current_a)
{
    const float voltage = springpot_is_finite(voltage_v) ? voltage_v : state->voltage.stages[0][1];
    const float current = springpot_is_finite(current_a) ? current_a : state->current.stages[0][1];
    const springpot_sample *sample = NULL;

    state->drive = springpot_demodulate(&state->voltage, voltage);
    (void)springpot_demodulate(&state->current, current);
    state->current_sum = state->current_sum + current;
    state->tick = state->tick + 1U;
    if (state->tick >= sensing->ticks) {
        state->tick = 0U;
        springpot_self_sensing_end_block(sensing, state);
    } else if (state->tick == 1U) {
        sample = springpot_self_sensing_estimate(sensing, state);
    } else {
        /* within a block */
    }
    return sample;
}

/* Standard deviation of the last sample, m. */
static inline float springpot_self_sensing_uncertainty(const springpot_self_sensing_state *state)
{
    return sqrtf(state->sample_variance);
}

/* Takes a sample of another sensor, of this variance (m^2): the next estimate is compared with it. While one waits, others are ignored. */
static inline void springpot_self_sensing_correct(const springpot_self_sensing *sensing, springpot_self_sensing_state *state,
    const springpot_sample *sample, float variance_m2)
{
    if ((state->is_pending == 0U) && springpot_is_finite(sample->displacement) && springpot_is_finite(variance_m2)
        && (variance_m2 > 0.0F)) {
        /* Ticks until the next estimate, which is made at tick 1 of a block. */
        const uint32_t to_come = (state->tick == 0U) ? 1U : ((sensing->ticks + 1U) - state->tick);
        const uint32_t most = UINT32_MAX - to_come;
        state->is_pending = 1U;
        state->pending.displacement = sample->displacement;
        state->pending.age_ticks = ((sample->age_ticks < most) ? sample->age_ticks : most) + to_come;
        state->pending_variance = variance_m2;
    }
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif

#endif /* SPRINGPOT_H */
