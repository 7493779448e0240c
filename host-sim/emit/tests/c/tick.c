/* A tick of tracking, to see how large it is. */
#include "springpot.h"

float tick(const springpot_film *film, springpot_tracking_state *state, float voltage, const springpot_sample *sample,
    float reference);

float tick(const springpot_film *film, springpot_tracking_state *state, float voltage, const springpot_sample *sample,
    float reference)
{
    (void)springpot_tracking_observe(film, state, voltage, SPRINGPOT_NO_READING, sample);
    return springpot_tracking_command(film, state, reference).voltage;
}
