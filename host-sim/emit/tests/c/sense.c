/* A tick of self-sensing, to see how large it is. */
#include "springpot.h"

float sense(const springpot_self_sensing *sensing, springpot_self_sensing_state *state, float voltage, float current,
    float *displacement);

float sense(const springpot_self_sensing *sensing, springpot_self_sensing_state *state, float voltage, float current,
    float *displacement)
{
    const springpot_sample *sample = springpot_self_sensing_sense(sensing, state, voltage, current);
    if (sample != NULL) {
        *displacement = sample->displacement;
    }
    return springpot_self_sensing_drive(sensing, state, voltage);
}
