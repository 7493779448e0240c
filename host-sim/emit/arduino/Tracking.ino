// Follows a sine of 2 to 2.5 mm with a displacement sensor.
//
// HIGH VOLTAGE. This shows the calls and their order, no more: it has no interlock, no watch on voltage and film, and no emergency
// stop. Try it with the amplifier switched off, and put a supervisor in front of the amplifier before it is switched on.
#include <springpot.h>

SPRINGPOT_FILM(@SYMBOL@);

// The bench: pins and scales. Adjust them to yours.
static const int COMMAND_PIN = 9;                  // the amplifier's command
static const int SENSOR_PIN = A0;                  // the displacement sensor
static const float VOLTS_PER_CODE = 6000.0F / 255.0F;
static const float METRES_PER_CODE = 10e-3F / 1023.0F;
static const float METRES_AT_REST = 1e-3F;         // reading of the film at rest

static springpot_follower_state state;
static float commanded_v = 0.0F;
static float angle = 0.0F;
static uint32_t next_us = 0U;
static float fraction_us = 0.0F;
static bool is_late = false;

void setup()
{
    springpot_follower_init(&@SYMBOL@, &state, true, true);  // with a sensor; cycles are learned if the film's file says so
    Serial.begin(115200);
    next_us = micros();
}

void loop()
{
    // One tick every step_s: the law is right at this rate and at no other. A board that misses a tick stops at 0 V.
    const float step_us = @SYMBOL@.step_s * 1e6F;
    const int32_t late_us = (int32_t)(micros() - next_us);
    if ((late_us < 0) || is_late) {
        return;
    }
    if (late_us > (int32_t)step_us) {
        is_late = true;
        analogWrite(COMMAND_PIN, 0);
        Serial.println("too slow: a tick was missed; export the film with a lower --rate");
        return;
    }
    fraction_us += step_us - (float)(uint32_t)step_us;
    const uint32_t whole_us = (uint32_t)fraction_us;
    fraction_us -= (float)whole_us;
    next_us += (uint32_t)step_us + whole_us;

    springpot_sample sample;
    sample.displacement = (METRES_PER_CODE * (float)analogRead(SENSOR_PIN)) - METRES_AT_REST;
    sample.age_ticks = 0U;

    angle += 6.2831853F * 0.1F * @SYMBOL@.step_s;  // 0.1 Hz
    if (angle > 6.2831853F) {
        angle -= 6.2831853F;
    }
    const springpot_command command =
        springpot_follower_step(&@SYMBOL@, &state, commanded_v, SPRINGPOT_NO_READING, &sample, 2.25e-3F - (0.25e-3F * cosf(angle)));

    // What is really applied goes into the next tick: here the voltage of the code, as it was rounded.
    const int code = (int)(command.voltage / VOLTS_PER_CODE);
    analogWrite(COMMAND_PIN, code);
    commanded_v = VOLTS_PER_CODE * (float)code;
}
