/* The tick of docs/c.md, in page.h: with a tone, and at 0 V from the fault of a broken current monitor on. */
#include <stdio.h>
#include "springpot.h"

SPRINGPOT_FILM(film);
SPRINGPOT_SELF_SENSING(self_sensing_film);

#include "page.h"

int main(void)
{
    static springpot_follower_state state;
    static springpot_self_sensing_state sensed;
    springpot_command command = {0.0F, 0.0F, 0.0F, 0U};
    float before = 0.0F;
    float current = 0.0F;
    springpot_follower_init(&film, &state, true, false);
    springpot_self_sensing_init(&self_sensing_film, &sensed);
    for (uint32_t k = 0U; k < 600U; k++) {
        const float voltage =
            sensed_tick(&film, &state, &self_sensing_film, &sensed, &command, before, current, 2e-4F);
        current = (k < 400U) ? (700e-9F * (voltage - before)) : 0.0F;
        before = voltage;
        if ((k == 399U) || (k == 599U)) {
            printf("%u %d %d\n", (unsigned)sensed.fault, voltage > 100.0F, command.voltage > 0.0F);
        }
    }
    return 0;
}
