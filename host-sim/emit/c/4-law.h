/* ---- The law of a film. */

/* What a film meets at a place: besides that on its curve how the curve bends, and the spring there. */
typedef struct {
    springpot_place place;
    float curvature; /* T'', 1/m; 0 beyond the ends */
    float force;     /* E, N */
    float steepness; /* E', N/m */
} springpot_ahead;

/* The place in a table of pieces from `low` to `high` (m). */
static inline springpot_ahead springpot_in_pieces(
    const springpot_piece *piece, uint32_t pieces, float low, float high, float displacement, float surplus)
{
    springpot_ahead ahead;
    float within;
    float u;
    float bent;
    float rise;

    /* A place below the first piece is in it, one above the last piece in the last. */
    if ((pieces > 8U) && !(displacement < piece[8].at)) {
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
    within = (displacement < low) ? low : displacement;
    within = (high < displacement) ? high : within;
    ahead.place.outside = displacement - within;
    u = (within - piece->at) - surplus;
    bent = u * piece->third;
    rise = piece->second + bent;
    ahead.place.knot = piece->value;
    ahead.place.slope = piece->slope + (u * (rise + (rise + bent)));
    ahead.place.beyond = (u * (piece->slope + (u * rise))) + (ahead.place.slope * ahead.place.outside);
    ahead.curvature = 0.0F;
    if (!(0.0F < (ahead.place.outside * ahead.place.outside))) {
        const float half = rise + (bent + bent);
        ahead.curvature = half + half;
    }
    ahead.force = 0.0F;
    ahead.steepness = 0.0F;
    return ahead;
}

/* What the film meets at `displacement` - `surplus` (m) from its origin. */
static inline springpot_ahead springpot_on_curve(const springpot_film *film, float displacement, float surplus)
{
    const springpot_curve *curve = film->curve;
    const springpot_spring *spring = film->spring;
    springpot_ahead ahead = springpot_in_pieces(curve->pieces, SPRINGPOT_PIECES, curve->low, curve->high, displacement, surplus);
    if (spring != NULL) {
        const springpot_place elastic
            = springpot_in_pieces(
            spring->spring_pieces, SPRINGPOT_SPRING_PIECES, spring->low, spring->high, displacement, surplus).place;
        ahead.force = elastic.knot + elastic.beyond;
        ahead.steepness = elastic.slope;
        ahead.place.outside = ahead.place.outside + elastic.outside;
    }
    return ahead;
}

/* T at `here` minus T at `there`, m. */
static inline float springpot_between(const springpot_place *here, const springpot_place *there)
{
    return (here->knot - there->knot) + (here->beyond - there->beyond);
}

/* What the film meets if it goes on with `increment` (m). */
static inline springpot_ahead springpot_look_ahead(const springpot_film *film, const springpot_state *state, float increment)
{
    const float addend = increment - state->position_surplus;
    const float position = state->position + addend;
    const float surplus = (position - state->position) - addend;
    return springpot_on_curve(film, position + state->origin, surplus);
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

/* Completes `state` for the next step: the force and the stiffness that it meets `ahead`, from the force of the `memory` there and that of
 * past increments in the `inertia` (N). */
static inline void springpot_meet(
    const springpot_film *film, springpot_state *state, const springpot_ahead *ahead, float memory, float inertia)
{
    const springpot_curve *curve = film->curve;
    const springpot_spring *spring = film->spring;
    const float slope = ahead->place.slope;
    if (spring == NULL) {
        state->base = memory;
        state->stiffness = (curve->instant * slope) + curve->inertia;
        state->slope = slope;
    } else {
        const float square = slope * slope;
        const float bent = ahead->curvature * memory;
        const float stiffness = (curve->instant * square) + (bent + (ahead->steepness + curve->inertia));
        state->base = (slope * memory) + (ahead->force + inertia);
        state->memory = memory;
        state->inertia = inertia;
        state->stiffness = (stiffness < spring->least) ? spring->least : stiffness;
        state->slope = (spring->spring_share * (ahead->steepness + bent)) + (spring->memory_share * square);
    }
}

/* Stores the newest increment (m) of a film behind a curve, which led to `place`, where T is `off` (m) from its value ahead. */
static inline void springpot_remember_bent(const springpot_film *film, springpot_state *state, float increment,
    const springpot_place *place, const springpot_ahead *ahead, float off)
{
    const springpot_curve *curve = film->curve;
    const float stretched = state->predicted + off;
    const float inertia = (curve->past_inertia[0] * increment)
        + ((curve->past_inertia[1] * state->increment) + (curve->past_inertia[2] * state->past));
    const float predicted = springpot_between(&ahead->place, place);
    const float change = curve->instant * (predicted - stretched);
    float remembered;

    state->ahead = ahead->place;
    state->predicted = predicted;
    state->past = state->increment;
    state->increment = increment;
    remembered = springpot_remember(&film->law, state, stretched);
    if (film->spring == NULL) {
        springpot_meet(film, state, ahead, remembered + (change + inertia), 0.0F);
    } else {
        springpot_meet(film, state, ahead, remembered + change, inertia);
    }
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
        springpot_ahead ahead;
        float off;
        place.beyond = place.beyond + (place.slope * change);
        off = place.beyond - state->ahead.beyond;
        ahead = springpot_look_ahead(film, state, increment);
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
    state->stiffness = film->law.stiffness;
    state->slope = 1.0F;
    state->memory = 0.0F;
    state->inertia = 0.0F;
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
        const springpot_place place = springpot_on_curve(film, 0.0F, 0.0F).place;
        const springpot_ahead ahead = springpot_look_ahead(film, state, 0.0F);
        state->ahead = ahead.place;
        state->predicted = springpot_between(&state->ahead, &place);
        springpot_meet(film, state, &ahead, 0.0F, 0.0F);
    }
}

/* Displacement (m) at the next step from the force (N) that acts in it: creep. */
static inline float springpot_displacement(const springpot_film *film, springpot_state *state, float force)
{
    return springpot_change_increment(film, state, (force - state->base) / state->stiffness);
}

/* The same under a load that depends on that displacement. */
static inline float springpot_displacement_under(const springpot_film *film, springpot_state *state, springpot_load load)
{
    const float force_ahead = load.force + (load.slope * (state->position + state->increment));
    return springpot_change_increment(film, state, (force_ahead - state->base) / (state->stiffness - load.slope));
}

/* The force (N) at what the film behind a curve meets `here`, and into `off` T there minus its value ahead (m). */
static inline float springpot_force_at(
    const springpot_film *film, const springpot_state *state, const springpot_ahead *here, float increment, float *off)
{
    const springpot_curve *curve = film->curve;
    const float change = increment - state->increment;
    float force;
    *off = springpot_between(&here->place, &state->ahead);
    if (film->spring == NULL) {
        force = state->base + ((curve->instant * *off) + (curve->inertia * change));
    } else {
        const float memory = state->memory + (curve->instant * *off);
        force = (here->place.slope * memory) + (here->force + (state->inertia + (curve->inertia * change)));
    }
    return force;
}

/* Force (N) that the film shows when it is at `displacement` (m) at the next step: relaxation. */
static inline float springpot_force(const springpot_film *film, springpot_state *state, float displacement)
{
    const float increment = (displacement - state->position) + state->position_surplus;
    float force;

    state->position = displacement;
    state->position_surplus = 0.0F;
    if (film->curve == NULL) {
        force = state->base + (film->law.stiffness * (increment - state->increment));
        state->increment = increment;
        state->base = springpot_remember(&film->law, state, increment);
    } else {
        const springpot_ahead here = springpot_on_curve(film, displacement + state->origin, 0.0F);
        springpot_ahead ahead = here;
        float off;
        force = springpot_force_at(film, state, &here, increment, &off);
        ahead.place.beyond = ahead.place.beyond + (ahead.place.slope * increment);
        ahead.force = ahead.force + (ahead.steepness * increment);
        springpot_remember_bent(film, state, increment, &here.place, &ahead, off);
    }
    return force;
}

/* Force (N) that would bring the film to `displacement` (m) at the next step. The state stays as it is. */
static inline float springpot_force_to(const springpot_film *film, const springpot_state *state, float displacement)
{
    const float increment = (displacement - state->position) + state->position_surplus;
    float force;
    if (film->curve == NULL) {
        force = state->base + (film->law.stiffness * (increment - state->increment));
    } else {
        const springpot_ahead here = springpot_on_curve(film, displacement + state->origin, 0.0F);
        float off;
        force = springpot_force_at(film, state, &here, increment, &off);
    }
    return force;
}

/* Whether the film is beyond the range of its curve, or of its spring, which go on linearly there. */
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

