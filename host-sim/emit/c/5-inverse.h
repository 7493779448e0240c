/* ---- From voltage to force and back, and the inverse that feedforward and tracking share. */

static inline float springpot_clamp(float value, float low, float high)
{
    float clamped = value;
    if (value < low) {
        clamped = low;
    } else if (value > high) {
        clamped = high;
    } else {
        /* within */
    }
    return clamped;
}

static inline float springpot_size(float value)
{
    return (value > 0.0F) ? value : (0.0F - value);
}

/* Neither infinite nor NaN: infinity minus itself is NaN, which equals nothing. */
static inline bool springpot_is_finite(float value)
{
    const float difference = value - value;
    return difference == 0.0F;
}

/* The load of `voltage` (V, either sign; clamped to the largest), weight included. */
static inline springpot_load springpot_load_of(const springpot_drive *drive, float voltage)
{
    const float clamped = springpot_clamp(voltage, -drive->max_voltage, drive->max_voltage);
    const float square = clamped * clamped;
    const float electrostatic =
        ((drive->force_per_square_volt * clamped) * clamped) / (1.0F + (square * drive->saturation));
    springpot_load load;
    load.force = electrostatic + drive->preload;
    load.slope = electrostatic * drive->coupling;
    return load;
}

/* The voltage (V, 0 or more) that exerts `force` (N, weight included) on the film at `displacement` (m); 0 V for forces below that of
 * 0 V, infinite for one at which the actuator saturates. Not clamped to the largest voltage. */
static inline float springpot_voltage_of(const springpot_drive *drive, float force, float displacement)
{
    const float electrostatic = force - drive->preload;
    const float thinned =
        drive->force_per_square_volt + ((drive->force_per_square_volt * drive->coupling) * displacement);
    const float per_square_volt = thinned - (electrostatic * drive->saturation);
    float voltage = 0.0F;
    if ((electrostatic > 0.0F) && (thinned > 0.0F)) {
        voltage = (per_square_volt > 0.0F) ? sqrtf(electrostatic / per_square_volt) : (float)INFINITY;
    }
    return voltage;
}

/* Moves the path by one tick towards `reference` (m). After one that is not finite the last one stays. Returns the limits. */
static inline uint32_t springpot_shape(const springpot_inverse *inverse, springpot_path *path, float reference)
{
    const float target = springpot_is_finite(reference) ? reference : path->target;
    const float motion = target - path->target;
    const float distance = path->target - path->position;
    const float size = springpot_size(distance);
    uint32_t limited = 0U;
    float approach = distance;
    float wanted;
    float allowed;
    float increment;

    path->target = target;
    if (!(size <= inverse->max_change)) {
        /* As fast as it can still brake. */
        const float root = sqrtf(1.0F + (8.0F * (size / inverse->max_change)));
        const float brakable = (0.5F * inverse->max_change) * (root - 1.0F);
        limited |= SPRINGPOT_ACCELERATION;
        approach = (distance < 0.0F) ? -brakable : brakable;
    }
    wanted = motion + approach;
    allowed = springpot_clamp(wanted, -inverse->max_increment, inverse->max_increment);
    if ((allowed < wanted) || (wanted < allowed)) {
        limited |= SPRINGPOT_VELOCITY;
    }
    increment =
        springpot_clamp(allowed, path->increment - inverse->max_change, path->increment + inverse->max_change);
    if ((increment < allowed) || (allowed < increment)) {
        limited |= SPRINGPOT_ACCELERATION;
    }
    path->change = increment - path->increment;
    path->increment = increment;
    path->position = path->position + increment;
    return limited;
}

/* `share` of an amplifier that is faster by `pace`. */
static inline float springpot_faster(float pace, float share)
{
    const float faster = pace * share;
    return (faster < 1.0F) ? faster : 1.0F;
}

/* The voltage (V) at the end of a tick under the command of `state`, from what it has made of those before. Learns from a `reading` (V),
 * if it is finite, how fast the amplifier is. */
static inline float springpot_follow(
    const springpot_film *film, springpot_inverse_state *state, float command, float reading)
{
    const springpot_amplifier *amplifier = film->amplifier;
    const float voltage = state->followed;
    const bool rises = command > voltage;
    const float nominal = rises ? amplifier->up : amplifier->down;
    const float share = springpot_faster(state->pace, nominal);
    const float left = 1.0F - springpot_faster(state->pace, 1.0F - amplifier->left);
    const float lowest = left * voltage;
    const float followed = voltage + (share * (command - voltage));
    const float next = (followed < lowest) ? lowest : followed;

    if ((!rises) && (next <= lowest)) {
        state->pace_slope = (left * state->pace_slope) - ((1.0F - amplifier->left) * voltage);
    } else if (share < 1.0F) {
        state->pace_slope = ((1.0F - share) * state->pace_slope) + (nominal * (command - voltage));
    } else {
        /* At once is as fast as it gets. */
        state->pace_slope = 0.0F;
    }
    if (springpot_is_finite(reading)) {
        const float forgotten = film->inverse.averaging;
        const float shown = reading / state->gain;
        const float low = (next > voltage) ? voltage : next;
        const float high = (next > voltage) ? next : voltage;
        const float difference = springpot_clamp(shown, low, high) - shown;
        const float error = amplifier->reading_share * film->inverse.max_voltage;
        const float ticks_per_s = (1.0F - forgotten) / (amplifier->gain_s * forgotten);
        const float initial = (error * error) * ticks_per_s;
        float step;
        state->information = ((1.0F - forgotten) * state->information) + (state->pace_slope * state->pace_slope);
        step = (state->pace_slope * difference) / (initial + state->information);
        state->pace = springpot_clamp(state->pace - step, amplifier->paces[0], amplifier->paces[1]);
    }
    return next;
}

static inline void springpot_inverse_init(springpot_inverse_state *state, float position)
{
    state->path.target = position;
    state->path.position = position;
    state->path.increment = 0.0F;
    state->path.change = 0.0F;
    state->commanded = 0.0F;
    state->followed = 0.0F;
    state->followed_mean = 0.0F;
    state->reading_mean = 0.0F;
    state->gain = 1.0F;
    state->pace = 1.0F;
    state->pace_slope = 0.0F;
    state->information = 0.0F;
}

/* The voltage on the film (V): behind the amplifier, with its gain. */
static inline float springpot_film_voltage(const springpot_inverse_state *state)
{
    return state->gain * state->followed;
}

/* Records what was applied, and returns the voltage that acted on the film (V). */
static inline float springpot_record(
    const springpot_film *film, springpot_inverse_state *state, float commanded, float reading)
{
    const springpot_inverse *inverse = &film->inverse;
    const float read = springpot_size(reading);
    const float applied = springpot_size(commanded);

    if (springpot_is_finite(applied)) {
        state->commanded = applied;
    }
    state->followed =
        (film->amplifier != NULL) ? springpot_follow(film, state, state->commanded, read) : state->commanded;
    if (springpot_is_finite(read)) {
        state->followed_mean = state->followed_mean + (inverse->averaging * (state->followed - state->followed_mean));
        state->reading_mean = state->reading_mean + (inverse->averaging * (read - state->reading_mean));
        if (state->followed_mean > (inverse->gain_share * inverse->max_voltage)) {
            state->gain =
                springpot_clamp(state->reading_mean / state->followed_mean, inverse->gains[0], inverse->gains[1]);
        }
    }
    return springpot_film_voltage(state);
}

/* The command that takes the film towards `reference` (m), against a force that the model does not know (N) and with the effect of the
 * electrostatic force over the model's. */
static inline springpot_command springpot_invert(const springpot_film *film, const springpot_state *law,
    springpot_inverse_state *state, float reference, float disturbance, float force_scale)
{
    const springpot_inverse *inverse = &film->inverse;
    const float offset = law->position - state->path.position;
    const float drift = law->increment - state->path.increment;
    uint32_t limited = springpot_shape(inverse, &state->path, reference);
    /* Limited to what it can brake. */
    const float max_approach = inverse->max_return / inverse->approach;
    const float approach = springpot_clamp(-(inverse->approach * offset), -max_approach, max_approach);
    const float correction =
        springpot_clamp(inverse->damping * (approach - drift), -inverse->max_return, inverse->max_return);
    const float change = state->path.change + correction;
    const float ahead = law->position + (law->increment + change);
    const float needed =
        ((law->base + (law->stiffness * change)) - disturbance) - film->drive.preload;
    const float force = needed / force_scale;
    /* The film thins as it lengthens. */
    const float thinning = 1.0F + (inverse->thinning * ahead);
    const float field_voltage = (thinning > 1.0F) ? (inverse->field_voltage / thinning) : inverse->field_voltage;
    const float largest = (field_voltage < inverse->max_voltage) ? field_voltage : inverse->max_voltage;
    float wanted = springpot_voltage_of(&film->drive, force + film->drive.preload, ahead) / state->gain;
    float allowed;
    float slewed;
    springpot_command command;

    if (force < 0.0F) {
        limited |= SPRINGPOT_BELOW_ZERO;
    }
    if (springpot_beyond_curve(law)) {
        limited |= SPRINGPOT_BEYOND_CURVE;
    }
    if (wanted > field_voltage) {
        limited |= SPRINGPOT_FIELD;
    }
    if (wanted > inverse->max_voltage) {
        limited |= SPRINGPOT_MAX_VOLTAGE;
    }
    wanted = (wanted > largest) ? largest : wanted;
    allowed = wanted;
    if (film->amplifier != NULL) {
        /* The command leads by as much as the amplifier lags. */
        const float nominal = (wanted > state->followed) ? film->amplifier->up : film->amplifier->down;
        const float left = 1.0F - springpot_faster(state->pace, 1.0F - film->amplifier->left);
        const float led =
            state->followed + ((wanted - state->followed) / springpot_faster(state->pace, nominal));
        const bool can_follow = wanted >= (left * state->followed);
        if ((led > largest) || (!can_follow)) {
            limited |= SPRINGPOT_AMPLIFIER;
        }
        allowed = (led > largest) ? largest : led;
    }
    slewed = springpot_clamp(allowed, state->commanded - inverse->slew, state->commanded + inverse->slew);
    if ((slewed < allowed) || (allowed < slewed)) {
        limited |= SPRINGPOT_SLEW;
    }
    /* The largest voltage has priority over the slew limit. */
    command.voltage = springpot_clamp(slewed, 0.0F, largest);
    command.reference = state->path.position;
    command.force = force;
    command.limited = limited;
    return command;
}

