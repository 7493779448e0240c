/* ---- The law of a film. */

/* What the spring of a film adds at a place. */
typedef struct {
    float force;     /* E, N */
    float steepness; /* E', N/m */
    float curvature; /* T'', 1/m; 0 beyond the ends of the curve */
} springpot_elastic;

/* Sets `place` to that in a table of pieces from `low` to `high` (m), and `curvature`, unless NULL, to how the curve bends there (1/m). */
static inline void springpot_in_pieces(const springpot_piece *piece, uint32_t pieces, float low, float high, float displacement,
    float surplus, springpot_place *place, float *curvature)
{
    float within;
    float u;
    float bent;
    float rise;
    float slope;
    float outside;

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
    outside = displacement - within;
    place->outside = outside;
    u = (within - piece->at) - surplus;
    bent = u * piece->third;
    rise = piece->second + bent;
    place->knot = piece->value;
    slope = piece->slope + (u * (rise + (rise + bent)));
    place->slope = slope;
    place->beyond = (u * (piece->slope + (u * rise))) + (slope * outside);
    if (curvature != NULL) {
        const float half = rise + (bent + bent);
        *curvature = (0.0F < (outside * outside)) ? 0.0F : (half + half);
    }
}

/* Likewise on the curve of a film beside its spring, and what the spring adds there. */
static SPRINGPOT_NOT_INLINED void springpot_beside_spring(
    const springpot_film *film, float displacement, float surplus, springpot_place *SPRINGPOT_RESTRICT place,
    springpot_elastic *SPRINGPOT_RESTRICT elastic)
{
    const springpot_curve *curve = film->curve;
    const springpot_spring *spring = film->spring;
    springpot_place on_spring;
    /* A film beside a spring has no more pieces in its curve. */
    springpot_in_pieces(
        curve->pieces, SPRINGPOT_SPRING_PIECES, curve->low, curve->high, displacement, surplus, place, &elastic->curvature);
    springpot_in_pieces(
        spring->spring_pieces, SPRINGPOT_SPRING_PIECES, spring->low, spring->high, displacement, surplus, &on_spring, NULL);
    elastic->force = on_spring.knot + on_spring.beyond;
    elastic->steepness = on_spring.slope;
    place->outside = place->outside + on_spring.outside;
}

/* Sets `place` to that on the film's curve at `displacement` - `surplus` (m) from its origin, and `elastic` if it has a spring. */
static inline void springpot_on_curve(
    const springpot_film *film, float displacement, float surplus, springpot_place *place, springpot_elastic *elastic)
{
    const springpot_curve *curve = film->curve;
    if (film->spring == NULL) {
        springpot_in_pieces(curve->pieces, SPRINGPOT_PIECES, curve->low, curve->high, displacement, surplus, place, NULL);
    } else {
        springpot_beside_spring(film, displacement, surplus, place, elastic);
    }
}

/* T at `here` minus T at `there`, m. */
static inline float springpot_between(const springpot_place *here, const springpot_place *there)
{
    return (here->knot - there->knot) + (here->beyond - there->beyond);
}

/* Sets the place ahead, and without a spring the stiffness there, to those at `displacement` - `surplus` (m) from the origin. */
static inline void springpot_meet(
    const springpot_film *film, springpot_state *state, float displacement, float surplus, springpot_elastic *elastic)
{
    springpot_on_curve(film, displacement, surplus, &state->ahead, elastic);
    if (film->spring == NULL) {
        state->stiffness = (film->curve->instant * state->ahead.slope) + film->curve->inertia;
        state->slope = state->ahead.slope;
    }
}

/* Sets the place ahead to where the film is if it goes on with `increment` (m). */
static inline void springpot_look_ahead(
    const springpot_film *film, springpot_state *state, float increment, springpot_elastic *elastic)
{
    const float addend = increment - state->position_surplus;
    const float position = state->position + addend;
    const float surplus = (position - state->position) - addend;
    springpot_meet(film, state, position + state->origin, surplus, elastic);
}

/* The force (N) of `count` fast modes, into which the increment `oldest` (m) flows. */
static inline float springpot_of_modes(
    const springpot_decay *SPRINGPOT_RESTRICT modes, float *SPRINGPOT_RESTRICT extensions, uint32_t count, float oldest)
{
    float force = 0.0F;
    uint32_t i;

    SPRINGPOT_UNROLL
    for (i = 0U; i < count; i++) {
        const float extension = extensions[i] + (oldest - (modes[i].loss * extensions[i]));
        extensions[i] = extension;
        force = force + (modes[i].weight * extension);
    }
    return force;
}

/* The force (N) of the `count` most recent increments (m). */
static inline float springpot_of_head(const float *head, const float *recent, uint32_t count)
{
    float force = head[0] * recent[0];
    uint32_t i;

    SPRINGPOT_UNROLL
    for (i = 1U; i < count; i++) {
        force = force + (head[i] * recent[i]);
    }
    return force;
}

/* Stores the newest increment (m) and returns the force (N) at the next step if the film went on with it. */
static inline float springpot_remember(
    const springpot_law *SPRINGPOT_RESTRICT law, springpot_state *SPRINGPOT_RESTRICT state, float increment)
{
    const uint32_t last = SPRINGPOT_HEAD - 1U;
    /* Beyond the last for 0, which wraps around. */
    const uint32_t before = state->newest - 1U;
    const uint32_t newest = (before < last) ? before : last;
    float *recent = &state->increments[newest];
    /* The slot of the newest increment still holds the oldest, which leaves the head. */
    const float oldest = recent[0];
    const float left_before = state->left;
    const float left_addend = oldest - state->left_surplus;
    const float left = left_before + left_addend;
    float slow = 0.0F;
    float fast;
    uint32_t i;

    state->newest = newest;
    recent[0] = increment;
    recent[SPRINGPOT_HEAD] = increment;
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
    fast = springpot_of_modes(law->fast, state->fast, SPRINGPOT_FAST, oldest);
    return slow + (fast + springpot_of_head(law->head, recent, SPRINGPOT_HEAD));
}

/* Completes `state` for the next step beside a spring: the force and the stiffness at the place ahead, from the force of the `memory` there
 * and that of past increments in the `inertia` (N). */
static inline void springpot_meet_spring(
    const springpot_film *film, springpot_state *state, const springpot_elastic *elastic, float memory, float inertia)
{
    const springpot_spring *spring = film->spring;
    const float slope = state->ahead.slope;
    const float square = slope * slope;
    const float bent = elastic->curvature * memory;
    const float stiffness = (film->curve->instant * square) + (bent + (elastic->steepness + film->curve->inertia));
    state->base = (slope * memory) + (elastic->force + inertia);
    state->memory = memory;
    state->inertia = inertia;
    state->stiffness = (stiffness < spring->least) ? spring->least : stiffness;
    state->slope = (spring->spring_share * (elastic->steepness + bent)) + (spring->memory_share * square);
}

/* What a spring in series is stretched by after an `increment` (m). */
static inline springpot_dashpot springpot_elongated(const springpot_state *state, float increment)
{
    const float addend = increment - state->elongation_surplus;
    springpot_dashpot elongated;
    elongated.displacement = state->elongation + addend;
    elongated.surplus = (elongated.displacement - state->elongation) - addend;
    return elongated;
}

/* Sets `place` to that on the spring in series after it was stretched by an `increment` (m). */
static inline void springpot_on_series(
    const springpot_curve *curve, const springpot_state *state, float increment, springpot_place *place)
{
    const springpot_dashpot at = springpot_elongated(state, increment);
    /* It has no more pieces than a spring beside the memory. */
    springpot_in_pieces(
        curve->pieces, SPRINGPOT_SPRING_PIECES, curve->low, curve->high, at.displacement, at.surplus, place, NULL);
}

/* How the memory's increment changes (m) if that of the film changes by `change` (m), along the tangent of the spring in series at `at`. */
static inline float springpot_shift(
    const springpot_curve *curve, const springpot_state *state, const springpot_place *at, float change)
{
    return ((at->slope * change) - (state->memory - (at->knot + at->beyond))) / (curve->instant + at->slope);
}

/* Completes `state` for the next step with a spring in series: the force and the stiffness that it meets ahead, from the force of the
 * `memory` there and that of past increments in the `inertia` (N). */
static inline void springpot_meet_series(
    const springpot_film *SPRINGPOT_RESTRICT film, springpot_state *SPRINGPOT_RESTRICT state, float memory, float inertia)
{
    const springpot_curve *curve = film->curve;
    const springpot_series *series = film->series;
    float share;
    float elastic;
    float slope;

    springpot_on_series(curve, state, state->increment - state->predicted, &state->ahead);
    slope = state->ahead.slope;
    share = slope / (curve->instant + slope);
    elastic = state->ahead.knot + state->ahead.beyond;
    state->base = elastic + ((share * (memory - elastic)) + inertia);
    state->memory = memory;
    state->inertia = inertia;
    state->stiffness = (curve->instant * share) + curve->inertia;
    state->slope = series->scale * (slope / (series->slow + slope));
}

/* Stores the elongation after an `increment` (m) of which the memory has the last one and a `shift` (m); returns that of the memory. */
static inline float springpot_stretch_series(springpot_state *state, float increment, float shift)
{
    const float stretched = state->predicted + shift;
    const springpot_dashpot elongated = springpot_elongated(state, increment - stretched);
    state->elongation = elongated.displacement;
    state->elongation_surplus = elongated.surplus;
    return stretched;
}

/* The force (N) of a film with a spring in series `increment` (m) from the last step, and how the memory's increment changes with it (m).
 * Two steps of Newton's method: a displacement may jump. */
static inline float springpot_force_series(
    const springpot_film *SPRINGPOT_RESTRICT film, const springpot_state *state, float increment, float *SPRINGPOT_RESTRICT shift)
{
    const springpot_curve *curve = film->curve;
    const float change = increment - state->increment;
    const float first = springpot_shift(curve, state, &state->ahead, change);
    springpot_place place;
    float last;

    /* The spring has what that leaves of the change; the rest along its tangent there. */
    springpot_on_series(curve, state, (increment - state->predicted) - first, &place);
    last = springpot_shift(curve, state, &place, first);
    *shift = last;
    return (state->memory + (curve->instant * last)) + (state->inertia + (curve->inertia * change));
}

/* Stores the newest `increment` (m) of a film with a curve, and returns the force (N) of past increments in the inertia. */
static inline float springpot_store(const springpot_curve *curve, springpot_state *state, float increment)
{
    const float inertia = (curve->past_inertia[0] * increment)
        + ((curve->past_inertia[1] * state->increment) + (curve->past_inertia[2] * state->past));
    state->past = state->increment;
    state->increment = increment;
    return inertia;
}

/* Stores the newest increment (m) of a film behind a curve, where T was `off` (m) from its value ahead, and will be `predicted` (m)
 * further at the new place ahead, which is in `state` already; or with a spring in series, whose memory is `predicted` (m) further now. */
static inline void springpot_remember_bent(const springpot_film *film, springpot_state *state, float increment, float off,
    float predicted, const springpot_elastic *elastic)
{
    const springpot_curve *curve = film->curve;
    const float stretched = state->predicted + off;
    const float inertia = springpot_store(curve, state, increment);
    const float change = curve->instant * (predicted - stretched);
    float remembered;

    state->predicted = predicted;
    remembered = springpot_remember(&film->law, state, stretched);
    if (film->series != NULL) {
        springpot_meet_series(film, state, remembered, inertia);
    } else if (film->spring == NULL) {
        state->base = remembered + (change + inertia);
    } else {
        springpot_meet_spring(film, state, elastic, remembered + change, inertia);
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
        springpot_elastic elastic;
        float off;
        float predicted;
        if (film->series != NULL) {
            off = springpot_shift(film->curve, state, &state->ahead, change);
            predicted = springpot_stretch_series(state, increment, off);
        } else {
            springpot_place place = state->ahead;
            place.beyond = place.beyond + (place.slope * change);
            off = place.beyond - state->ahead.beyond;
            springpot_look_ahead(film, state, increment, &elastic);
            predicted = springpot_between(&state->ahead, &place);
        }
        springpot_remember_bent(film, state, increment, off, predicted, &elastic);
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
    state->elongation = 0.0F;
    state->elongation_surplus = 0.0F;
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
    if (film->series != NULL) {
        springpot_meet_series(film, state, 0.0F, 0.0F);
    } else if (film->curve != NULL) {
        springpot_elastic elastic;
        springpot_place place;
        springpot_on_curve(film, 0.0F, 0.0F, &place, &elastic);
        springpot_look_ahead(film, state, 0.0F, &elastic);
        state->predicted = springpot_between(&state->ahead, &place);
        if (film->spring != NULL) {
            springpot_meet_spring(film, state, &elastic, 0.0F, 0.0F);
        }
    } else {
        /* Nothing bends. */
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

/* The force (N) of a film behind a curve `increment` (m) from its last step, where T has the `slope` and is `off` (m) from that ahead. */
static inline float springpot_force_at(const springpot_film *film, const springpot_state *state, float slope,
    const springpot_elastic *elastic, float increment, float off)
{
    const springpot_curve *curve = film->curve;
    const float change = increment - state->increment;
    float force;
    if (film->spring == NULL) {
        force = state->base + ((curve->instant * off) + (curve->inertia * change));
    } else {
        const float memory = state->memory + (curve->instant * off);
        force = (slope * memory) + (elastic->force + (state->inertia + (curve->inertia * change)));
    }
    return force;
}

/* Force (N) that a film with a spring in series shows when it is `increment` (m) from its last step at the next one. */
static SPRINGPOT_NOT_INLINED float springpot_step_series(
    const springpot_film *SPRINGPOT_RESTRICT film, springpot_state *SPRINGPOT_RESTRICT state, float increment)
{
    float shift;
    const float force = springpot_force_series(film, state, increment, &shift);
    const float inertia = springpot_store(film->curve, state, increment);
    const float stretched = springpot_stretch_series(state, increment, shift);
    state->predicted = stretched;
    springpot_meet_series(film, state, springpot_remember(&film->law, state, stretched), inertia);
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
    } else if (film->series != NULL) {
        force = springpot_step_series(film, state, increment);
    } else {
        const springpot_place ahead = state->ahead;
        springpot_elastic elastic;
        springpot_place here;
        float off;
        springpot_meet(film, state, displacement + state->origin, 0.0F, &elastic);
        here = state->ahead;
        off = springpot_between(&here, &ahead);
        force = springpot_force_at(film, state, here.slope, &elastic, increment, off);
        state->ahead.beyond = here.beyond + (here.slope * increment);
        if (film->spring != NULL) {
            elastic.force = elastic.force + (elastic.steepness * increment);
        }
        springpot_remember_bent(film, state, increment, off, state->ahead.beyond - here.beyond, &elastic);
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
    } else if (film->series != NULL) {
        float shift;
        force = springpot_force_series(film, state, increment, &shift);
    } else {
        springpot_elastic elastic;
        springpot_place here;
        springpot_on_curve(film, displacement + state->origin, 0.0F, &here, &elastic);
        force = springpot_force_at(film, state, here.slope, &elastic, increment, springpot_between(&here, &state->ahead));
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

