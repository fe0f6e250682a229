// A stub of an Arduino board for tests, no board: time stands still but for the loop, and the USB line is a script, or a
// pseudo-terminal.
#pragma once
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <string>

extern uint32_t stub_now;      // us
extern std::string stub_line;  // what has been sent to the board by now
extern FILE *stub_usb;         // where it writes
extern char stub_harm[256];    // of each servo: 's' does not answer, 'a' reports an error
inline uint32_t micros() { return stub_now; }
inline void delay(uint32_t) {
  printf("WRONG: it waits\n");
  exit(1);
}

struct HardwareSerial {
  void begin(unsigned long) {}
  int available() { return (int)stub_line.size(); }
  int read() {
    int letter = stub_line.empty() ? -1 : (unsigned char)stub_line[0];
    stub_line.erase(0, 1);
    return letter;
  }
  void print(const char *text) { fputs(text, stub_usb); }
  void print(char letter) { putc(letter, stub_usb); }
  void print(long number) { fprintf(stub_usb, "%ld", number); }
  void println(const char *text = "") { fprintf(stub_usb, "%s\n", text); }
  void println(int number) { fprintf(stub_usb, "%d\n", number); }
};
extern HardwareSerial Serial, Serial1;
