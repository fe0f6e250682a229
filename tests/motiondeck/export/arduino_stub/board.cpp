// Runs a sketch on the stub of a board for some ticks of 10 ms; lines of the standard input are a tick and what is sent then.
#include "Arduino.h"

#include <stdlib.h>

#include <iostream>

uint32_t stub_now;
std::string stub_line;
HardwareSerial Serial, Serial1;
void setup();
void loop();

int main(int, char **given) {
  uint32_t ticks = (uint32_t)atoi(given[1]), tick = 0;
  bool more = (bool)(std::cin >> tick);
  std::string text;
  setup();
  for (; stub_now < 10000 * ticks; stub_now += 500) {
    for (; more && stub_now + 500 > 10000 * tick; more = (bool)(std::cin >> tick)) {
      std::getline(std::cin >> std::ws, text);
      stub_line += text + "\r\n";
    }
    loop();
  }
}
