/* ---- The law of a film. */

static inline springpot_place springpot_on_curve(const springpot_curve *curve, float displacement, float surplus)
{
    springpot_place place;
    const springpot_piece *piece = curve->pieces;
    float within;
    float u;
    float bent;
    float rise;

    /* A place below the first piece is in it, one above the last piece in the last. */
    if (!(displacement < piece[8].at)) {
        piece += 8;
    }
    if (!(displacement < piece[4].at)) {
        piece += 4;
    }
    if (!(displacement < piece[2].at)) {
        piece += 2;
    }
    if (!(displacement < piece[1].at)) {
        piece += 1;
    }
    within = (displacement < curve->low) ? curve->low : displacement;
    within = (curve->high < displacement) ? curve->high : within;
    place.outside = displacement - within;
    u = (within - piece->at) - surplus;
    bent = u * piece->third;
    rise = piece->second + bent;
    place.knot = piece->value;
    place.slope = piece->slope + (u * (rise + (rise + bent)));
    place.beyond = (u * (piece->slope + (u * rise))) + (place.slope * place.outside);
    return place;
}

/* T at `here` minus T at `there`, m. */
static inline float springpot_between(const springpot_place *here, const springpot_place *there)
{
    return (here->knot - there->knot) + (here->beyond - there->beyond);
}

/* The place where the film will be if it goes on with `increment` (m). */
static inline springpot_place springpot_look_ahead(const springpot_curve *curve, const springpot_state *state, float increment)
{
    const float addend = increment - state->position_surplus;
    const float position = state->position + addend;
    const float surplus = (position - state->position) - addend;
    return springpot_on_curve(curve, position + state->origin, surplus);
}

/* Stores the newest increment (m) and returns the force (N) at the next step if the film went on with it. */
static inline float springpot_remember(
    const springpot_law *SPRINGPOT_RESTRICT law, springpot_state *SPRINGPOT_RESTRICT state, float increment)
{
    const uint32_t last = SPRINGPOT_HEAD - 1U;
    const uint32_t before = (state->newest < last) ? state->newest : last;
    const uint32_t newest = (before == 0U) ? last : (before - 1U);
    /* The slot of the newest increment still holds the oldest, which leaves the head. */
    const float oldest = state->increments[newest];
    const float left_before = state->left;
    const float left_addend = oldest - state->left_surplus;
    const float left = left_before + left_addend;
    const float *recent = &state->increments[newest];
    float slow = 0.0F;
    float fast = 0.0F;
    float head = 0.0F;
    uint32_t i;

    state->newest = newest;
    state->increments[newest] = increment;
    state->increments[newest + SPRINGPOT_HEAD] = increment;
    state->left_surplus = (left - left_before) - left_addend;
    state->left = left;
    SPRINGPOT_UNROLL
    for (i = 0U; i < SPRINGPOT_SLOW; i++) {
        springpot_dashpot *dashpot = &state->slow[i];
        const float start = dashpot->displacement;
        const float addend = (law->slow[i].loss * (left_before - start)) - dashpot->surplus;
        const float displacement = start + addend;
        dashpot->surplus = (displacement - start) - addend;
        dashpot->displacement = displacement;
        slow = slow + (law->slow[i].weight * (left - displacement));
    }
    SPRINGPOT_UNROLL
    for (i = 0U; i < SPRINGPOT_FAST; i++) {
        const float extension = state->fast[i] + (oldest - (law->fast[i].loss * state->fast[i]));
        state->fast[i] = extension;
        fast = fast + (law->fast[i].weight * extension);
    }
    SPRINGPOT_UNROLL
    for (i = 0U; i < SPRINGPOT_HEAD; i++) {
        head = head + (law->head[i] * recent[i]);
    }
    return slow + (fast + head);
}

/* Stores the newest increment (m) of a film behind a curve, which led to `place`, where T is `off` (m) from its value ahead. */
static inline void springpot_remember_bent(const springpot_film *film, springpot_state *state, float increment,
    const springpot_place *place, const springpot_place *ahead, float off)
{
    const springpot_curve *curve = film->curve;
    const float stretched = state->predicted + off;
    const float inertia = (curve->past_inertia[0] * increment)
        + ((curve->past_inertia[1] * state->increment) + (curve->past_inertia[2] * state->past));
    const float predicted = springpot_between(ahead, place);
    const float change = (curve->instant * (predicted - stretched)) + inertia;

    state->ahead = *ahead;
    state->predicted = predicted;
    state->past = state->increment;
    state->increment = increment;
    state->base = springpot_remember(&film->law, state, stretched) + change;
}

/* Force per displacement within the next step, N/m. */
static inline float springpot_stiffness(const springpot_film *film, const springpot_state *state)
{
    return (film->curve == NULL) ? film->law.stiffness : ((film->curve->instant * state->ahead.slope) + film->curve->inertia);
}

static inline float springpot_change_increment(const springpot_film *film, springpot_state *state, float change)
{
    const float increment = state->increment + change;
    /* Kahan's sum: what was rounded away comes back with the next increment. */
    const float addend = increment - state->position_surplus;
    const float position = state->position + addend;

    state->position_surplus = (position - state->position) - addend;
    state->position = position;
    if (film->curve == NULL) {
        state->increment = increment;
        state->base = springpot_remember(&film->law, state, increment);
    } else {
        springpot_place place = state->ahead;
        springpot_place ahead;
        float off;
        place.beyond = place.beyond + (place.slope * change);
        off = place.beyond - state->ahead.beyond;
        ahead = springpot_look_ahead(film->curve, state, increment);
        springpot_remember_bent(film, state, increment, &place, &ahead, off);
    }
    return position;
}

/* Sets `state` to a film at rest at x = 0. */
static inline void springpot_init(const springpot_film *film, springpot_state *state)
{
    uint32_t i;

    state->position = 0.0F;
    state->position_surplus = 0.0F;
    state->increment = 0.0F;
    state->base = 0.0F;
    state->origin = 0.0F;
    state->ahead.knot = 0.0F;
    state->ahead.beyond = 0.0F;
    state->ahead.slope = 1.0F;
    state->ahead.outside = 0.0F;
    state->predicted = 0.0F;
    state->past = 0.0F;
    state->newest = 0U;
    state->left = 0.0F;
    state->left_surplus = 0.0F;
    for (i = 0U; i < (2U * SPRINGPOT_HEAD); i++) {
        state->increments[i] = 0.0F;
    }
    for (i = 0U; i < SPRINGPOT_FAST; i++) {
        state->fast[i] = 0.0F;
    }
    for (i = 0U; i < SPRINGPOT_SLOW; i++) {
        state->slow[i].displacement = 0.0F;
        state->slow[i].surplus = 0.0F;
    }
    if (film->curve != NULL) {
        const springpot_place place = springpot_on_curve(film->curve, 0.0F, 0.0F);
        state->ahead = springpot_look_ahead(film->curve, state, 0.0F);
        state->predicted = springpot_between(&state->ahead, &place);
    }
}

/* Displacement (m) at the next step from the force (N) that acts in it: creep. */
static inline float springpot_displacement(const springpot_film *film, springpot_state *state, float force)
{
    return springpot_change_increment(film, state, (force - state->base) / springpot_stiffness(film, state));
}

/* The same under a load that depends on that displacement. */
static inline float springpot_displacement_under(const springpot_film *film, springpot_state *state, springpot_load load)
{
    const float force_ahead = load.force + (load.slope * (state->position + state->increment));
    const float stiffness = springpot_stiffness(film, state);
    return springpot_change_increment(film, state, (force_ahead - state->base) / (stiffness - load.slope));
}

static inline float springpot_force_at(
    const springpot_film *film, const springpot_state *state, float increment, const springpot_place *place)
{
    const float change = increment - state->increment;
    float force;
    if (film->curve == NULL) {
        force = state->base + (film->law.stiffness * change);
    } else {
        const float off = springpot_between(place, &state->ahead);
        force = state->base + ((film->curve->instant * off) + (film->curve->inertia * change));
    }
    return force;
}

/* Force (N) that the film shows when it is at `displacement` (m) at the next step: relaxation. */
static inline float springpot_force(const springpot_film *film, springpot_state *state, float displacement)
{
    const float increment = (displacement - state->position) + state->position_surplus;
    springpot_place place = state->ahead;
    float force;

    state->position = displacement;
    state->position_surplus = 0.0F;
    if (film->curve == NULL) {
        force = springpot_force_at(film, state, increment, &place);
        state->increment = increment;
        state->base = springpot_remember(&film->law, state, increment);
    } else {
        springpot_place ahead;
        float off;
        place = springpot_on_curve(film->curve, displacement + state->origin, 0.0F);
        off = springpot_between(&place, &state->ahead);
        force = springpot_force_at(film, state, increment, &place);
        ahead = place;
        ahead.beyond = ahead.beyond + (ahead.slope * increment);
        springpot_remember_bent(film, state, increment, &place, &ahead, off);
    }
    return force;
}

/* Force (N) that would bring the film to `displacement` (m) at the next step. The state stays as it is. */
static inline float springpot_force_to(const springpot_film *film, const springpot_state *state, float displacement)
{
    const float increment = (displacement - state->position) + state->position_surplus;
    springpot_place place = state->ahead;
    if (film->curve != NULL) {
        place = springpot_on_curve(film->curve, displacement + state->origin, 0.0F);
    }
    return springpot_force_at(film, state, increment, &place);
}

/* Whether the film is beyond the range of its curve, which goes on linearly there. */
static inline bool springpot_beyond_curve(const springpot_state *state)
{
    return (state->ahead.outside < 0.0F) || (0.0F < state->ahead.outside);
}

/* Measures displacement from `origin` (m) from now on: a sensor that is zeroed on a film that has already crept. */
static inline void springpot_move_origin(springpot_state *state, float origin)
{
    state->origin = state->origin + origin;
    state->position = (state->position - origin) - state->position_surplus;
    state->position_surplus = 0.0F;
}

