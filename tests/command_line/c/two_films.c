/* Two films, one after the other, that learn a periodic reference: the bits of every voltage. */
#include <stdio.h>
#include <string.h>
#include "springpot.h"

SPRINGPOT_FILM(film_rich_1);
SPRINGPOT_FILM(film_n1);

int main(void)
{
    const springpot_film *const films[2] = {&film_rich_1, &film_n1};
    for (uint32_t f = 0U; f < 2U; f++) {
        static springpot_follower_state state;
        springpot_command command = {0.0F, 0.0F, 0.0F, 0U};
        springpot_follower_init(films[f], &state, false, true);
        for (uint32_t k = 0U; k < 12000U; k++) {
            const uint32_t turn = k % 1000U;
            const float u = (float)((turn < 500U) ? turn : (1000U - turn)) / 500.0F;
            const float reference = 0.6e-3F + (0.2e-3F * ((u * u) * (3.0F - (2.0F * u))));
            const float reading = 1.02F * command.voltage;
            springpot_follower_state next = state;
            springpot_sample sample;
            uint32_t bits;
            sample.displacement = 1.04F * springpot_follower_observe(films[f], &next, command.voltage, reading, NULL);
            sample.age_ticks = 0U;
            command = springpot_follower_step(films[f], &state, command.voltage, reading,
                                              (k % 10U == 0U) ? &sample : NULL, reference);
            memcpy(&bits, &command.voltage, sizeof bits);
            printf("%08x\n", (unsigned)bits);
        }
    }
    return 0;
}
