//! A library for Arduino and PlatformIO.
