// Runs a sketch on the stub of a board: for some ticks of 10 ms, where lines of the standard input are a tick and what is
// sent then; or on a pseudo-terminal whose descriptor is given as "pty FD". There lines of the standard input are "run TICKS
// BYTES" (once at least so many bytes in all have come; answered with how many it has sent in all) and "harm SERVO KIND".
#include "Arduino.h"

#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include <iostream>

uint32_t stub_now;
std::string stub_line;
FILE *stub_usb = stdout;
char stub_harm[256];
HardwareSerial Serial, Serial1;
void setup();
void loop();

static int on_terminal(int terminal) {
  std::string word;
  char *text = NULL, piece[4096];
  size_t size = 0, come = 0, sent = 0, until;
  uint32_t ticks, servo;
  stub_usb = open_memstream(&text, &size);
  setup();
  while (std::cin >> word) {
    if (word == "harm") {
      std::cin >> servo;
      std::cin >> stub_harm[servo & 255];
      continue;
    }
    std::cin >> ticks >> until;
    for (pollfd ready = {terminal, POLLIN, 0}; come < until || poll(&ready, 1, 0) > 0;) {
      ssize_t got = read(terminal, piece, sizeof piece);
      if (got <= 0) return 1;
      stub_line.append(piece, (size_t)got), come += (size_t)got;
    }
    for (uint32_t end = stub_now + 10000 * ticks; stub_now != end; stub_now += 500) loop();
    fflush(stub_usb);
    if (write(terminal, text + sent, size - sent) != (ssize_t)(size - sent)) return 1;
    sent = size;
    printf("%zu\n", sent);
    fflush(stdout);
  }
  return 0;
}

int main(int count, char **given) {
  if (count > 2) return on_terminal(atoi(given[2]));
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
