/* What tests/chip-program does in Rust, in C: checksums of every bit, and what a step costs. */
#include "chip.h"

#include <string.h>

#include "springpot.h"

#define STEPS 1000U

extern const springpot_film *const job_films[];
extern const springpot_self_sensing *const job_sensing[];
extern const uint32_t job_count;

static uint32_t out_file;
static uint64_t checksum;
static volatile float sink;

static void begin(void)
{
    checksum = 0xcbf29ce484222325U;
}

static void add(float value)
{
    uint32_t bits;
    uint32_t byte;
    memcpy(&bits, &value, sizeof bits);
    for (byte = 0U; byte < 4U; byte++) {
        checksum = (checksum ^ ((bits >> (8U * byte)) & 0xffU)) * 0x100000001b3U;
    }
}

static void print(const char *kind, const char *what, uint32_t film, uint64_t value)
{
    char line[64];
    uint32_t at = 0U;
    uint32_t digit;
    const char *words[2];
    uint32_t w;
    words[0] = kind;
    words[1] = what;
    for (w = 0U; w < 2U; w++) {
        const char *letter = words[w];
        while (*letter != '\0') {
            line[at] = *letter;
            at++;
            letter++;
        }
        line[at] = ' ';
        at++;
    }
    line[at] = (char)('0' + (char)(film / 10U));
    line[at + 1U] = (char)('0' + (char)(film % 10U));
    line[at + 2U] = ' ';
    at += 3U;
    for (digit = 0U; digit < 16U; digit++) {
        line[at] = "0123456789abcdef"[(value >> (60U - (4U * digit))) & 0xfU];
        at++;
    }
    line[at] = '\n';
    chip_write(out_file, line, at + 1U);
}

/* As the Rust program: laws are called, ticks of control are inlined into the loop that is counted. */
#define CALLED __attribute__((noinline))
#define IN_PLACE inline __attribute__((always_inline))

typedef float (*step)(const springpot_film *film, float k);

/* Instructions of a step beyond those of its loop, which computes what goes in. */
static IN_PLACE void cost(const char *what, uint32_t number, const springpot_film *film, step one, float scale)
{
    uint32_t start;
    uint32_t idle;
    uint32_t work;
    uint32_t k;
    start = chip_moment();
    for (k = 0U; k < STEPS; k++) {
        sink = scale * (float)k;
    }
    idle = chip_between(start, chip_moment());
    start = chip_moment();
    for (k = 0U; k < STEPS; k++) {
        sink = one(film, scale * (float)k);
    }
    work = chip_between(start, chip_moment());
    print("cost", what, number, (work - idle) / STEPS);
}

static springpot_state law;
static springpot_feedforward_state feedforward;
static springpot_observer_state observer;
static springpot_tracking_state tracking;
static springpot_learning_state learning;
static const springpot_self_sensing *sensing;
static springpot_self_sensing_state sensed;
static float voltage;
static uint32_t since;

static CALLED float creep(const springpot_film *film, float force)
{
    return springpot_displacement(film, &law, force);
}

static CALLED float relaxation(const springpot_film *film, float displacement)
{
    return springpot_force(film, &law, displacement);
}

static CALLED float voltage_of(const springpot_film *film, float force)
{
    return springpot_voltage_of(&film->drive, force, 0.001F);
}

static float reference(float k)
{
    return (1e-9F * k) * k;
}

static springpot_sample sample_of(float k)
{
    springpot_sample sample;
    sample.displacement = 0.98F * reference(k);
    sample.age_ticks = 10U;
    return sample;
}

static IN_PLACE float feedforward_tick(const springpot_film *film, float k)
{
    springpot_command command;
    (void)springpot_feedforward_apply(film, &feedforward, voltage, SPRINGPOT_NO_READING);
    command = springpot_feedforward_command(film, &feedforward, reference(k));
    voltage = command.voltage;
    return voltage;
}

static IN_PLACE float observer_tick(const springpot_film *film, float k)
{
    const springpot_sample sample = sample_of(k);
    return springpot_observer_observe(film, &observer, 5.0F * k, &sample);
}

static IN_PLACE float tracking_tick(const springpot_film *film, float k)
{
    const springpot_sample sample = sample_of(k);
    springpot_command command;
    (void)springpot_tracking_observe(film, &tracking, voltage, SPRINGPOT_NO_READING, &sample);
    command = springpot_tracking_command(film, &tracking, reference(k));
    voltage = command.voltage;
    return voltage;
}

static IN_PLACE float learning_tick(const springpot_film *film, float k)
{
    since = (since == 9U) ? 0U : (since + 1U);
    if (since == 0U) {
        const springpot_sample sample = sample_of(k);
        springpot_learning_observe(&learning, &sample);
    }
    return springpot_learning_advance(film, &learning, reference(k), 0U);
}

static IN_PLACE float sensing_tick(const springpot_film *film, float k)
{
    const float before = voltage;
    const springpot_sample *sample;
    (void)film;
    voltage = springpot_self_sensing_drive(sensing, &sensed, 5.0F * k);
    sample = springpot_self_sensing_sense(sensing, &sensed, voltage, (700e-9F + (1e-10F * k)) * (voltage - before));
    return (sample != NULL) ? (sample->displacement + sensed.sample_variance) : sensed.drive;
}

/* The first tick of a block, which has the displacement: in the mean of some blocks. */
static void longest_tick(uint32_t number, const springpot_film *film)
{
    uint32_t cost_of_all = 0U;
    uint32_t k;
    for (k = 0U; k < STEPS; k++) {
        const uint32_t idle = chip_moment();
        const uint32_t start = chip_moment();
        sink = sensing_tick(film, 3.0F);
        cost_of_all += ((k % sensing->ticks) == 0U) ? (chip_between(start, chip_moment()) - chip_between(idle, start)) : 0U;
    }
    print("cost", "self-sensing-longest", number, cost_of_all / (STEPS / sensing->ticks));
}

/* Bits along the way, then what a step costs. */
static IN_PLACE void ticks(const char *what, uint32_t number, const springpot_film *film, step one)
{
    uint32_t k;
    begin();
    for (k = 0U; k < STEPS; k++) {
        add(one(film, (float)k));
    }
    print("bits", what, number, checksum);
    cost(what, number, film, one, 1.0F);
}

static void run(uint32_t number)
{
    const springpot_film *const film = job_films[number];
    uint32_t k;

    springpot_init(film, &law);
    begin();
    for (k = 0U; k < STEPS; k++) {
        add(creep(film, 1e-4F * ((float)k * (float)k)));
    }
    print("bits", "creep", number, checksum);
    springpot_init(film, &law);
    begin();
    for (k = 0U; k < STEPS; k++) {
        add(relaxation(film, 1e-9F * ((float)k * (float)k)));
    }
    print("bits", "relaxation", number, checksum);
    springpot_init(film, &law);
    cost("creep", number, film, creep, 0.1F);
    springpot_init(film, &law);
    cost("relaxation", number, film, relaxation, 1e-6F);

    begin();
    for (k = 0U; k < STEPS; k++) {
        add(voltage_of(film, 0.1F * (float)k));
    }
    print("bits", "voltage", number, checksum);
    cost("voltage", number, film, voltage_of, 0.1F);

    voltage = 0.0F;
    springpot_feedforward_init(film, &feedforward);
    ticks("feedforward", number, film, feedforward_tick);
    springpot_observer_init(film, &observer);
    ticks("observer", number, film, observer_tick);
    voltage = 0.0F;
    springpot_tracking_init(film, &tracking);
    ticks("tracking", number, film, tracking_tick);
    voltage = 0.0F;
    springpot_tracking_init(film, &tracking);
    springpot_tracking_set_adapting(&tracking, SPRINGPOT_ADAPT_LEARN);
    ticks("adaptive", number, film, tracking_tick);
    if (film->learning != NULL) {
        springpot_learning_init(film, &learning, 0.0F);
        since = 0U;
        for (k = 0U; k < (3U * STEPS); k++) {
            const springpot_sample sample = sample_of((float)k);
            springpot_learning_observe(&learning, &sample);
            (void)springpot_learning_advance(film, &learning, reference((float)k), 0U);
        }
        ticks("learning", number, film, learning_tick);
    }
    if (job_sensing[number] != NULL) {
        sensing = job_sensing[number];
        voltage = 0.0F;
        springpot_self_sensing_init(sensing, &sensed);
        ticks("self-sensing", number, film, sensing_tick);
        longest_tick(number, film);
    }
}

int chip_main(void)
{
    uint32_t number;
    out_file = chip_open("output", 6U, 5U);
    for (number = 0U; number < job_count; number++) {
        run(number);
    }
    return 0;
}
