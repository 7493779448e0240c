/* A board without pins: a second of the sketch, and how often, how far and with what in the end it wrote. */
#include <Arduino.h>
#include <stdio.h>

static unsigned long now;
static int writes, largest, last;
Port Serial;

void Port::println(const char *text)
{
    printf("%s\n", text);
}

unsigned long micros()
{
    return now;
}

int analogRead(int)
{
    return 102 + (int)(2.0e-3 * largest);
}

void analogWrite(int, int code)
{
    ++writes;
    last = code;
    if (code > largest) {
        largest = code;
    }
}

int main()
{
    setup();
    for (; now < 1000000UL; now += LOOP_US) {
        loop();
    }
    printf("%d %d %d\n", writes, largest, last);
}
