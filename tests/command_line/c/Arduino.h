#pragma once
#include <stdint.h>
#include <math.h>

#define A0 14

unsigned long micros();
int analogRead(int pin);
void analogWrite(int pin, int code);
void setup();
void loop();

struct Port {
    void begin(long) {}
    void println(const char *text);
};

extern Port Serial;
