/* ---- States: what changes with every tick. The caller owns them; `init` sets all of one. */

/* The place of a film on its curve, or on its spring in series: then `knot` and `beyond` are in N and `slope` in N/m. */
typedef struct {
    float knot;    /* T at the knot below, m */
    float beyond;  /* T minus that, m */
    float slope;   /* T' */
    float outside; /* how far the film is beyond the ends of the curve, m; 0 within them */
} springpot_place;

typedef struct {
    float displacement; /* m */
    float surplus;      /* what rounding added to it, m */
} springpot_dashpot;

/* The state of a law. */
typedef struct {
    float position;         /* displacement at the last step, m */
    float position_surplus; /* what rounding added to it, m */
    float increment;        /* of displacement in the last step, m */
    float base;             /* force at the next step if the increment stays, N */
    float origin;           /* where position 0 lies on the curve, m */
    springpot_place ahead;  /* the place at the next step if the increment stays */
    float predicted;        /* T there minus T at the last step, m */
    float past;             /* the increment before the last, m */
    float stiffness;        /* force per displacement within the next step, N/m */
    float slope;            /* stiffness of slow changes at that step over that at rest */
    float memory;           /* with a spring: force of the memory at that step, N */
    float inertia;          /* likewise, of past increments, N */
    float elongation;         /* of a spring in series, m; `ahead` is then on it, and `predicted` the memory's increment */
    float elongation_surplus; /* what rounding added to it, m */
    uint32_t newest;        /* of the increments below */
    float left;             /* displacement that has left the head, m */
    float left_surplus;     /* what rounding added to it, m */
    float increments[2U * SPRINGPOT_HEAD]; /* the last ones, twice */
    float fast[SPRINGPOT_FAST];            /* extensions of the fast springs, m */
    springpot_dashpot slow[SPRINGPOT_SLOW];
} springpot_state;

/* The shaped reference. */
typedef struct {
    float target;    /* the reference of the last tick, m */
    float position;  /* the shaped one, m */
    float increment; /* its last increment, m */
    float change;    /* of the increment in the last tick, m */
} springpot_path;

/* The state of the inverse and of the amplifier. */
typedef struct {
    springpot_path path;
    float commanded; /* size of the voltage that was commanded last, V */
    float followed;  /* what the amplifier has made of it, apart from its gain, V */
    float followed_mean; /* V */
    float reading_mean;  /* V */
    float gain;        /* of the amplifier, as its monitor shows it */
    float pace;        /* how much faster it is than its time constants say */
    float pace_slope;  /* V */
    float information; /* V^2 */
} springpot_inverse_state;

typedef struct {
    springpot_state film;
    springpot_inverse_state inverse;
} springpot_feedforward_state;

/* A force that depends on where the film is: force + slope x. */
typedef struct {
    float force; /* N */
    float slope; /* N/m */
} springpot_load;

/* For reading: film.position is the estimate (m), disturbance the force that the model does not know (N), force_scale the effect
 * of the electrostatic force over the model's, innovation the last sample minus its prediction (m). */
typedef struct {
    springpot_state film;
    float integral;     /* N */
    float slope;        /* N in a tick */
    float proportional; /* N */
    float disturbance;  /* N */
    float force_scale;
    float integral_mean; /* N */
    float load_mean;     /* N */
    float excitation;    /* N^2 */
    uint32_t since_sample; /* ticks since the last sample arrived */
    float innovation;      /* m */
    float innovation_mean; /* over the last few hundred samples, m */
    float innovation_variance; /* likewise, m^2 */
    springpot_load load;   /* of the voltage that acted in the last tick */
    float share;           /* of the correction that is in use */
    springpot_gains gains;
    float adapting;
    uint32_t newest;
    float past[SPRINGPOT_PAST]; /* predictions of the last ticks, m */
} springpot_observer_state;

typedef struct {
    float position; /* m */
    float high_passed;    /* m */
    float net_excursion;  /* mean size of that, m */
    float path_length[2]; /* mean path length of the reference, smoothed once and twice, m */
    float share;
} springpot_fade_state;

/* How a film differs from its law. */
typedef struct {
    uint32_t is_in_use;  /* 1: the film is not, or need not stay, as its law has it */
    uint32_t adapting;   /* SPRINGPOT_ADAPT_OFF, _HOLD or _LEARN */
    uint32_t phase;      /* the tick of a round */
    float stiffer;       /* share by which what relaxes is stiffer than the law has it */
    float loss_before;   /* loss of the mode before in a step */
    float log_before;    /* logarithm of its rate */
    float sums[2];       /* forces of the slopes in this round: as they are, and times the logarithms, N */
    float stated[2];     /* logarithms of force scale and rate at the temperature that was stated */
    float stated_used[2]; /* the part of them that is in use */
    float rate;          /* logarithm of the factor of all rates that is in use */
    float steps[2];      /* changes of rate and stretch in the last round */
    uint32_t is_excited; /* 1: the load swings */
    float ageing;
    float misfit;        /* mean square of the differences between what is found and estimated, over the variance that is expected of them */
    float doubt;         /* variance of the force scale when it was last learned, in squares of what is expected */
    float estimates[SPRINGPOT_PARAMETERS];
    float used[SPRINGPOT_PARAMETERS];     /* the part of them that is in use */
    float forces[SPRINGPOT_PARAMETERS];   /* by which they act, N */
    float diagonal[SPRINGPOT_PARAMETERS]; /* the covariance of the estimates as U D U': D, and the columns of U above its diagonal */
    float upper[SPRINGPOT_ABOVE];
    float slopes[SPRINGPOT_FAST + SPRINGPOT_SLOW]; /* derivatives of the modes' extensions by the logarithms of their rates, m */
} springpot_adaptation_state;

typedef struct {
    springpot_observer_state observer;
    springpot_inverse_state inverse;
    springpot_fade_state fade;
    float most; /* the share of the correction that is left to the observer where cycles are learned */
    uint32_t limited; /* limits that the last command met */
    springpot_adaptation_state adaptation;
} springpot_tracking_state;

/* Sizes on every target: nothing is padded. */
SPRINGPOT_ASSERT(sizeof(springpot_state) == 416U, a_state_of_a_law_takes_416_bytes);
SPRINGPOT_ASSERT(sizeof(springpot_feedforward_state) == 464U, a_state_of_feedforward_takes_464_bytes);
SPRINGPOT_ASSERT(sizeof(springpot_observer_state) == 752U, a_state_of_an_observer_takes_752_bytes);
SPRINGPOT_ASSERT(sizeof(springpot_tracking_state) == 1172U, a_state_of_tracking_takes_1172_bytes);

/* ---- Inputs and outputs. */

/* A sample of the displacement sensor. */
typedef struct {
    float displacement;  /* m; one that is not finite is ignored */
    uint32_t age_ticks;  /* how many ticks ago it was measured; 0 is now */
} springpot_sample;

/* Limits that a command met: bits of `limited`. */
#define SPRINGPOT_BELOW_ZERO 1U     /* a force below that of 0 V: voltage can only lengthen the film */
#define SPRINGPOT_MAX_VOLTAGE 2U    /* the largest voltage */
#define SPRINGPOT_FIELD 4U          /* the largest field */
#define SPRINGPOT_SLEW 8U           /* the largest change of voltage in a tick */
#define SPRINGPOT_VELOCITY 16U      /* the largest speed of the shaped reference */
#define SPRINGPOT_ACCELERATION 32U  /* the largest acceleration of the shaped reference */
#define SPRINGPOT_BEYOND_CURVE 64U  /* the film is beyond the stroke that its curve was measured over */
#define SPRINGPOT_AMPLIFIER 128U    /* what the amplifier can follow */

/* How tracking follows a film that changes. */
#define SPRINGPOT_ADAPT_OFF 0U   /* the law is as it was fitted; what was learned goes out of use within some seconds */
#define SPRINGPOT_ADAPT_HOLD 1U  /* nothing is learned, and what was learned stays in use */
#define SPRINGPOT_ADAPT_LEARN 2U /* the law follows its film */

/* How a film differs from its law, as far as it is in use. */
typedef struct {
    float force_scale; /* effect of the electrostatic force over the model's: below 1 for a film that has become stiffer */
    float uncertainty; /* standard deviation of the force scale, over it, from how well the estimates explain the forces that were found */
    float memory;      /* logarithm of what relaxes over what the law has */
    float rate;        /* logarithm of the factor of the relaxation rates */
    float stretch;     /* orders of springpots are those of the law over 1 + stretch */
    float bias_n;      /* constant force that is kept without a sensor, N */
    float ageing;      /* how far the film has moved from its law, 0 below three standard deviations: fit again from 1 on */
} springpot_adapted;

/* The command of a tick. */
typedef struct {
    float voltage;    /* V, 0 to the largest */
    float reference;  /* the shaped reference at the end of this tick, m */
    float force;      /* the electrostatic force that it needs, N; negative where no voltage can give it */
    uint32_t limited; /* the limits that were met */
} springpot_command;

