/* ---- A film: computed by the host, constant. Its values are for the functions below; read step_s and the limits if you like.
 * What has no unit here is a plain number. Generated from the visits of the crate springpot. */

/* A mode of the memory: a Maxwell element. */
typedef struct {
    float loss;   /* 1 - rho, what it forgets in a step */
    float weight; /* stiffness of its spring, N/m */
} springpot_decay;

/* The law of a film: F_k = sum over g_j dx_(k-j), the inertia included. */
typedef struct {
    float stiffness;                      /* force per displacement within one step, N/m */
    float head[SPRINGPOT_HEAD];           /* g_0 + g_1, g_2, ..., N/m */
    springpot_decay fast[SPRINGPOT_FAST]; /* fastest first */
    springpot_decay slow[SPRINGPOT_SLOW];
} springpot_law;

/* A cubic from `at` on: value + slope u + second u^2 + third u^3. */
typedef struct {
    float at;     /* m; infinite where the piece is not used */
    float value;  /* m; N where the piece is one of a spring, and so on */
    float slope;
    float second; /* 1/m */
    float third;  /* 1/m^2 */
} springpot_piece;

/* An elastic curve T in front of a law: its memory acts on T(x), the inertia on x. */
typedef struct {
    float instant;                            /* force per T within one step, N/m */
    float inertia;                            /* of the change of the increment, N/m */
    float past_inertia[3];                    /* of the last three increments, newest first, N/m */
    float low;                                /* where it begins, m */
    float high;                               /* where it ends, m */
    springpot_piece pieces[SPRINGPOT_PIECES];
} springpot_curve;

/* The curve is a spring S in series with the memory, force over elongation. */
typedef struct {
    float slow;  /* stiffness of slow changes of the memory, N/m */
    float scale; /* 1 plus that over the spring's stiffness at rest */
} springpot_series;

/* A spring E beside the memory, whose force then has the weight T'. */
typedef struct {
    float least;                                            /* least stiffness of a step, N/m */
    float spring_share;                                     /* of E' in the stiffness over that at rest, m/N */
    float memory_share;                                     /* of T'^2 */
    float low;                                              /* where it begins, m */
    float high;                                             /* where it ends, m */
    springpot_piece spring_pieces[SPRINGPOT_SPRING_PIECES];
} springpot_spring;

/* Voltage to force and back: F = force_per_square_volt V^2 / (1 + saturation V^2) (1 + coupling x) + preload. */
typedef struct {
    float force_per_square_volt; /* N/V^2 */
    float coupling;              /* 1/m */
    float saturation;            /* 1/V^2 */
    float preload;               /* N */
    float max_voltage;           /* V; larger ones count as this */
} springpot_drive;

/* Shaping of references, and the limits of a command. */
typedef struct {
    float max_increment; /* of the shaped reference in a tick, m */
    float max_change;    /* of that increment in a tick, m */
    float damping;
    float approach;
    float max_return;    /* m */
    float max_voltage;   /* V */
    float field_voltage; /* at which the field is largest at x = 0, V */
    float thinning;      /* of the film with displacement, 1/m */
    float slew;          /* largest change of voltage in a tick, V */
    float averaging;     /* weight of a tick in the means of the voltage */
    float gain_share;    /* of the largest voltage, above which the amplifier's gain is seen */
    float gains[2];      /* bounds of that gain */
} springpot_inverse;

/* An amplifier that lags. */
typedef struct {
    float up;            /* share of the distance to the command that it goes in a tick, upwards */
    float down;          /* and downwards */
    float left;          /* share of the voltage that is left after a tick at a command of 0 V */
    float reading_share;
    float gain_s;        /* s */
    float paces[2];      /* bounds of how much faster it may be */
} springpot_amplifier;

/* Gains of the observer on an innovation. */
typedef struct {
    float proportional; /* N/m */
    float integral;     /* N/m in a tick */
    float slope;        /* N/m in a tick, squared */
} springpot_gains;

/* The observer. */
typedef struct {
    springpot_gains gains;
    uint32_t lost_after;    /* ticks without a sample after which the sensor counts as lost */
    float smoothing;
    float recovery;
    float averaging;
    float forgetting;
    float forgetting_slope;
    float adapting;         /* 1: the force scale adapts; 0: it stays 1 */
    float regularisation;   /* N^2 */
    float excited;          /* N: smallest swing of the load that teaches the force scale */
    float max_disturbance;  /* N */
    float max_slope;        /* N in a tick */
    float max_innovation;   /* m */
    float statistics;       /* weight of a sample in the statistics */
    float full_share;       /* of the correction, above which the force scale adapts */
    float scales[2];        /* bounds of the force scale */
} springpot_observer;

/* How much of the correction is in use for references that are faster than the observer. */
typedef struct {
    float high_pass;
    float averaging;
    float smoothing;
    float floor;     /* m */
    float intercept;
    float slope;
    float min_share;
} springpot_fade;

/* How a film may differ from its law: force scale, memory, rate, stretch, then the bias in N. */
typedef struct {
    float expected;      /* standard deviation before a sensor has shown anything */
    float bound;
    float restored;      /* bound of what was learned before */
    float forgetting;    /* growth of its variance in a round, over it */
    float relinearising; /* the same for a change of rate or stretch */
    float aged;          /* 1 over the change at which the film has aged by 1; 0: none does */
} springpot_parameter;

/* How a film that changes is followed. */
typedef struct {
    uint32_t first;                                       /* the first mode that follows */
    uint32_t count;                                       /* modes that follow */
    float step;                                           /* s */
    float lasting;                                        /* stiffness of what does not relax, N/m */
    float relaxing;                                       /* within one step, N/m */
    float share;                                          /* of what relaxes in the stiffness */
    float stiffness;                                      /* at the observer's bandwidth, N/m */
    float ticks;                                          /* of a round */
    float blend;                                          /* share of an estimate that comes into use in a round */
    float averaging;                                      /* of the bias, while the load stays, and of the misfit */
    float precision;                                      /* 1/N */
    float excited;                                        /* N: smallest swing of the load that distinguishes parameters */
    float plausible;
    float described;                                      /* share of a bound beyond which no values describe a film */
    float wandering;                                      /* growth of the variance of the force scale in a round */
    float by_chance;                                      /* standard deviations by which an estimate differs from its law */
    float min_change;                                     /* of the stiffness that is reported */
    float forgotten;                                      /* share of what is expected that is out of use */
    float logarithm[2];
    float exponential[2];
    springpot_parameter parameters[SPRINGPOT_PARAMETERS];
} springpot_adaptation;

/* Learning of periodic references. */
typedef struct {
    float min_swing;              /* of a reference that counts, m */
    float swing_decay;            /* share of a swing that is lost in a tick */
    float hysteresis;
    float overdue;                /* periods without a crossing after which a reference is not periodic */
    float agreement;
    float period;                 /* ticks; 0 where it is taken from the reference */
    uint32_t harmonics;           /* that are learned, beside the mean */
    float largest_angle;          /* in a tick, of a harmonic that is learned, rad */
    float rate;                   /* ticks in a second */
    float approach;
    float slow;                   /* up to which a harmonic is slow, rad/s */
    float initial_step_size;
    float probing_step_size;
    float step_size;
    float inverse_gains[2];
    float mean_inverse_gains[2];
    float significance;
    float drift_unknown[2];
    float drift_kept;
    float drift_significance;
    uint32_t unresponsive_blocks;
    float growth[3];
    float noise_parts;
    float excess;
    float excess_samples;
    float taken;
    float caution[2];
    float harm;
    float trust[2];
    float settled[2];
    float no_error;               /* m^2 */
    float series_angle;           /* largest angle of the series of cosine and sine, rad */
    float cosine[4];
    float sine[4];
    float settling_s[2];
    float min_block_s[2];
    float max_block_s;
    float min_samples;
    float smoothing;
    float fade_weight;
    float same_period;
    float faded_out;
    float turn;                   /* 2 pi */
} springpot_learning;

/* How the film changes with its temperature: springpot_temperature_factors. */
typedef struct {
    float reference;  /* at which it is its law, degrees C */
    float stiffness;  /* change of the stiffness, 1/K */
    float activation; /* energy of relaxation and creep, kJ/mol */
} springpot_temperature;

/* The film as its own sensor. J is the phasor of the current, V that of the voltage. */
typedef struct {
    uint32_t ticks;                                     /* of a block */
    uint32_t age;                                       /* of its sample, ticks */
    float tone;                                         /* amplitude, V */
    float capacitance;                                  /* factor of |J|^2 / (V x J) */
    float resistance;                                   /* factor of (V . J) / |J|^2 */
    float voltage_noise;                                /* variance of V in a block */
    float current_noise;                                /* of J */
    float variance;                                     /* of the relation, m^2 */
    float drift;                                        /* share of it that returns in a block */
    float least_weight;                                 /* of a block in the mean of V */
    float another;                                      /* square of the distance of another tone from that mean, in variances */
    uint32_t others;                                    /* blocks with another tone that give no sample */
    uint32_t settling;                                  /* blocks at the start that are not used */
    uint32_t faulty;                                    /* blocks in a row that are a fault */
    float min_voltage;                                  /* square of the voltage's phasor */
    float max_current;                                  /* sum of a block, A */
    float min_admittance;                               /* square of the current's phasor over that of the voltage */
    float rest_admittance;                              /* likewise, of the film at rest */
    float min_capacitance;                              /* F */
    float max_capacitance;                              /* F */
    float rest;                                         /* capacitance, F */
    float per_rest;                                     /* 1/F */
    float changes[2];                                   /* least and largest of it, relative */
    float stroke[3];                                    /* m */
    float slope[2];                                     /* m */
    float creep;
    float instant;
    float creep_stiffness;
    float creep_head[4];                                /* g_0 + g_1, g_2, ... */
    springpot_decay creep_modes[SPRINGPOT_CREEP_MODES];
} springpot_self_sensing;

/* The constants of a film at its rate. */
typedef struct {
    float step_s;                             /* duration of a tick, s: call a tick at this rate and no other */
    springpot_drive drive;
    springpot_inverse inverse;
    springpot_observer observer;
    springpot_fade fade;
    springpot_adaptation adaptation;
    const springpot_curve *curve;             /* NULL: force follows x itself */
    const springpot_spring *spring;           /* NULL: no spring is beside the memory */
    const springpot_series *series;           /* NULL: no spring is in series with the memory */
    const springpot_amplifier *amplifier;     /* NULL: it follows at once */
    const springpot_learning *learning;       /* NULL: nothing is learned */
    const springpot_temperature *temperature; /* NULL: it was not fitted at several */
    springpot_law law;
} springpot_film;

