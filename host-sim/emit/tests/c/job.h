/* A job: a law or a law of control along given inputs. Rows of words in and out, as tests/it/job.rs writes and reads them. */
#include <string.h>

#include "springpot.h"

#define JOB_OUTPUTS 6U

/* The platform's: whole pieces, false at the end. */
static bool job_read(void *to, uint32_t bytes);
static void job_write(const void *from, uint32_t bytes);

extern const springpot_film *const job_films[];
extern const springpot_self_sensing *const job_sensing[];

typedef struct {
    float a;
    float b;
    float sample;
    uint32_t age; /* UINT32_MAX without a sample */
    uint32_t flags;
} job_input;

static uint32_t job_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void job_row(float o0, float o1, float o2, float o3, uint32_t o4, uint32_t o5)
{
    uint32_t row[JOB_OUTPUTS];
    row[0] = job_bits(o0);
    row[1] = job_bits(o1);
    row[2] = job_bits(o2);
    row[3] = job_bits(o3);
    row[4] = o4;
    row[5] = o5;
    job_write(row, (uint32_t)sizeof row);
}

/* All but the ageing, the change of the stiffness, and the share of the correction. */
static uint32_t job_adapted(const springpot_adapted *adapted, float change, float share)
{
    return job_bits(change) ^ job_bits(share) ^ job_bits(adapted->force_scale) ^ job_bits(adapted->uncertainty) ^ job_bits(adapted->memory)
        ^ job_bits(adapted->rate) ^ job_bits(adapted->stretch) ^ job_bits(adapted->bias_n);
}

static void job_adapt(const springpot_film *film, springpot_follower_state *follower, const job_input *in)
{
    if ((in->flags & 512U) != 0U) {
        springpot_follower_set_adapting(follower, SPRINGPOT_ADAPT_LEARN);
    }
    if ((in->flags & 1024U) != 0U) {
        springpot_follower_set_adapting(follower, SPRINGPOT_ADAPT_HOLD);
    }
    if ((in->flags & 2048U) != 0U) {
        springpot_follower_set_adapting(follower, SPRINGPOT_ADAPT_OFF);
    }
    if ((in->flags & 4096U) != 0U) {
        springpot_adapted adapted = {0.0F, 0.01F, 0.1F, -0.4F, 0.0F, 0.02F, 0.25F};
        adapted.force_scale = 0.9F * in->b;
        adapted.stretch = 220.0F * in->a;
        (void)springpot_follower_restore(film, follower, &adapted);
    }
    if ((in->flags & 8192U) != 0U) {
        springpot_follower_forget_changes(follower);
    }
    if ((in->flags & 16384U) != 0U) {
        if (film->temperature != NULL) {
            (void)springpot_follower_set_temperature(film, follower, 20.0F + (3000.0F * in->a));
        } else {
            (void)springpot_follower_set_temperature_factors(film, follower, 0.8F * in->b, 700.0F * in->a);
        }
    }
}

/* Self-sensing. */
static void job_sense(const springpot_self_sensing *sensing, uint32_t steps)
{
    static springpot_self_sensing_state state;
    uint32_t k;

    memset(&state, 0xa5, sizeof state);
    springpot_self_sensing_init(sensing, &state);
    for (k = 0U; k < steps; k++) {
        job_input in;
        const springpot_sample *sample;
        float tone;
        if (!job_read(&in, (uint32_t)sizeof in)) {
            return;
        }
        if ((in.flags & 1U) != 0U) {
            springpot_self_sensing_init(sensing, &state);
        }
        if (in.age != UINT32_MAX) {
            springpot_sample other;
            other.displacement = in.sample;
            other.age_ticks = in.age;
            springpot_self_sensing_correct(sensing, &state, &other, 1e-10F);
        }
        sample = springpot_self_sensing_sense(sensing, &state, in.a, in.b);
        tone = springpot_self_sensing_drive(sensing, &state, in.a);
        if (sample != NULL) {
            job_row(sample->displacement, springpot_self_sensing_uncertainty(&state), state.capacitance, state.resistance, job_bits(tone),
                state.fault + (16U * sample->age_ticks));
        } else {
            job_row(state.drive, state.offset, 0.0F, 0.0F, job_bits(tone), state.fault);
        }
    }
}

static void job_run(uint32_t kind, const springpot_film *film, uint32_t steps)
{
    static springpot_state law;
    static springpot_observer_state observer;
    static springpot_follower_state follower;
    float commanded = 0.0F;
    volatile float zero = 0.0F;
    uint32_t k;

    /* What the memory held before must not matter. */
    memset(&law, 0xa5, sizeof law);
    memset(&observer, 0xa5, sizeof observer);
    memset(&follower, 0xa5, sizeof follower);
    springpot_init(film, &law);
    springpot_observer_init(film, &observer);
    springpot_follower_init(film, &follower, kind > 3U, kind == 5U);
    for (k = 0U; k < steps; k++) {
        job_input in;
        springpot_sample sample;
        const springpot_sample *arrived;
        float put_out; /* share of a command; NaN where it is not known */
        if (!job_read(&in, (uint32_t)sizeof in)) {
            return;
        }
        sample.displacement = in.sample;
        sample.age_ticks = in.age;
        arrived = (in.age == UINT32_MAX) ? NULL : &sample;
        put_out = ((in.flags & 8U) != 0U) ? (zero / zero) : (((in.flags & 4U) != 0U) ? 0.5F : 1.0F);
        if (kind == 0U) {
            const float x = springpot_displacement(film, &law, in.a);
            const float to = springpot_force_to(film, &law, 1.001F * x);
            float held = 0.0F;
            if (in.flags != 0U) {
                held = springpot_force(film, &law, x);
            }
            job_row(x, law.base, law.increment, to, job_bits(held), springpot_beyond_curve(&law) ? 1U : 0U);
        } else if (kind == 1U) {
            const float to = springpot_force_to(film, &law, in.b);
            const float force = springpot_force(film, &law, in.a);
            if (in.flags != 0U) {
                springpot_move_origin(&law, in.b);
            }
            job_row(force, law.base, law.increment, to, job_bits(law.position), springpot_beyond_curve(&law) ? 1U : 0U);
        } else if (kind == 3U) {
            const float x = springpot_observer_observe(film, &observer, in.a, arrived);
            job_row(x, observer.disturbance, observer.force_scale, observer.innovation_mean,
                job_bits(observer.innovation_variance), observer.since_sample);
        } else {
            const float applied = commanded * put_out;
            const bool stands_by = (in.flags & 2U) != 0U;
            float x;
            springpot_command command;
            if ((in.flags & 1U) != 0U) {
                springpot_follower_forget_correction(&follower);
            }
            if ((in.flags & 16U) != 0U) {
                springpot_follower_carry_over(&follower);
            }
            if ((in.flags & 32U) != 0U) {
                springpot_follower_end_run(&follower);
            }
            if ((in.flags & 64U) != 0U) {
                springpot_follower_forget_cycles(film, &follower);
            }
            if ((in.flags & (128U | 256U)) != 0U) {
                springpot_follower_set_feedback(&follower, (in.flags & 256U) != 0U);
            }
            job_adapt(film, &follower, &in);
            x = springpot_follower_observe(film, &follower, applied, in.b * applied, arrived);
            command = stands_by ? springpot_follower_standby(film, &follower) : springpot_follower_command(film, &follower, in.a);
            commanded = command.voltage;
            if (follower.has_sensor != 0U) {
                const springpot_observer_state *corrected = &follower.of.tracking.observer;
                const springpot_adapted adapted = springpot_follower_adapted(film, &follower);
                job_row(x, command.voltage, (kind == 5U) ? springpot_follower_added(&follower) : adapted.ageing,
                    corrected->disturbance, job_adapted(&adapted, springpot_follower_stiffness_change(film, &follower), corrected->share), command.limited);
            } else {
                job_row(x, command.voltage, command.reference, command.force,
                    job_bits(springpot_film_voltage(&follower.of.feedforward.inverse)), command.limited);
            }
        }
    }
}

static int job_all(void)
{
    uint32_t head[3];
    while (job_read(head, (uint32_t)sizeof head)) {
        if (head[0] == 6U) {
            job_sense(job_sensing[head[1]], head[2]);
        } else {
            job_run(head[0], job_films[head[1]], head[2]);
        }
    }
    return 0;
}
