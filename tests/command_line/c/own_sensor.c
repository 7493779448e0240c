/* A film that is its own sensor, as a capacitor that grows: the bits of its samples. */
#include <stdio.h>
#include <string.h>
#include "springpot.h"

SPRINGPOT_SELF_SENSING(self_sensing_film);

int main(void)
{
    static springpot_self_sensing_state state;
    float before = 0.0F;
    float current = 0.0F;
    springpot_self_sensing_init(&self_sensing_film, &state);
    for (uint32_t k = 0U; k < 2000U; k++) {
        const springpot_sample *sample = springpot_self_sensing_sense(&self_sensing_film, &state, before, current);
        const float voltage = springpot_self_sensing_drive(&self_sensing_film, &state, (float)k);
        current = (700e-9F + (2e-11F * (float)k)) * (voltage - before);
        before = voltage;
        if (sample != NULL) {
            uint32_t bits;
            memcpy(&bits, &sample->displacement, sizeof bits);
            printf("%08x\n", (unsigned)bits);
        }
    }
    return (int)state.fault;
}
