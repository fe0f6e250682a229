// A stub of the maker's library Dynamixel2Arduino for tests, with the signatures that the sketch uses and servos that only
// remember. It prints goals that are sent, and WRONG where a real servo would refuse, or move at once.
#pragma once
#include "Arduino.h"

namespace ControlTableItem {
enum ControlTableItemIndex { OPERATING_MODE = 9, PROFILE_ACCELERATION = 60, PROFILE_VELOCITY, BUS_WATCHDOG };
}

namespace DYNAMIXEL {
typedef struct InfoSyncBulkBuffer {
  uint8_t *p_buf;
  uint16_t buf_capacity;
  uint16_t gen_length;
  bool is_completed;
} __attribute__((packed)) InfoSyncBulkBuffer_t;
typedef struct XELInfoSyncWrite {
  uint8_t *p_data;
  uint8_t id;
} __attribute__((packed)) XELInfoSyncWrite_t;
typedef struct InfoSyncWriteInst {
  uint16_t addr;
  uint16_t addr_length;
  XELInfoSyncWrite_t *p_xels;
  uint8_t xel_count;
  bool is_info_changed;
  InfoSyncBulkBuffer_t packet;
} __attribute__((packed)) InfoSyncWriteInst_t;
typedef struct XELInfoSyncRead {
  uint8_t *p_recv_buf;
  uint8_t id;
  uint8_t error;
} __attribute__((packed)) XELInfoSyncRead_t;
typedef struct InfoSyncReadInst {
  uint16_t addr;
  uint16_t addr_length;
  XELInfoSyncRead_t *p_xels;
  uint8_t xel_count;
  bool is_info_changed;
  InfoSyncBulkBuffer_t packet;
} __attribute__((packed)) InfoSyncReadInst_t;
}  // namespace DYNAMIXEL

class Dynamixel2Arduino {
  struct Servo {
    bool torque = true;
    int mode = -1, watchdog = -1;  // as it was left: its watchdog has struck
    int32_t goal = 0, place = 0;
  } servo[256];

 public:
  Dynamixel2Arduino(HardwareSerial &, int = -1) {
    for (int id = 0; id < 256; id++) servo[id].place = 2000 + id;
  }
  void begin(unsigned long) {}
  bool setPortProtocolVersion(float version) { return version == 2.0f; }
  bool ping(uint8_t) { return true; }
  bool torqueOff(uint8_t id) {
    if (servo[id].torque) printf("off %d\n", id);
    return servo[id].torque = false, true;
  }
  bool torqueOn(uint8_t id) {
    if (servo[id].goal != servo[id].place || servo[id].mode < 0) printf("WRONG: torque before its goal and mode\n");
    return servo[id].torque = true;
  }
  bool writeControlTableItem(uint8_t item, uint8_t id, int32_t value, uint32_t = 100) {
    if (item == ControlTableItem::OPERATING_MODE && servo[id].torque) printf("WRONG: a mode under torque\n");
    if (item == ControlTableItem::OPERATING_MODE) servo[id].mode = (int)value;
    if (item == ControlTableItem::BUS_WATCHDOG) servo[id].watchdog = (int)value;
    return true;
  }
  int32_t read(uint8_t id, uint16_t address, uint16_t length, uint8_t *data, uint16_t, uint32_t = 10) {
    if (address != 132) printf("WRONG: not the present position\n");
    memcpy(data, &servo[id].place, length);
    return length;
  }
  uint8_t syncRead(DYNAMIXEL::InfoSyncReadInst_t *all, uint32_t = 10) {
    uint8_t came = 0;
    if (all->addr != 132 || all->addr_length != 4 || !all->is_info_changed) printf("WRONG: not the present positions\n");
    for (; came < all->xel_count && stub_harm[all->p_xels[came].id] != 's'; came++) {
      uint8_t id = all->p_xels[came].id;
      memcpy(all->p_xels[came].p_recv_buf, &servo[id].place, 4);
      all->p_xels[came].error = stub_harm[id] == 'a' ? 0x80 : 0;
    }
    return came;
  }
  bool syncWrite(DYNAMIXEL::InfoSyncWriteInst_t *all) {
    if (all->addr != 116 || all->addr_length != 4 || !all->is_info_changed) printf("WRONG: no new goals\n");
    bool driven = true;
    for (int k = 0; k < all->xel_count; k++) {
      Servo &one = servo[all->p_xels[k].id];
      if (one.watchdog < 0) printf("WRONG: its watchdog has struck, it refuses goals\n");
      memcpy(&one.goal, all->p_xels[k].p_data, 4);
      driven = driven && one.torque && one.watchdog == 10;
      if (one.torque) one.place = one.goal;
    }
    if (!driven) return true;
    printf("goals");
    for (int k = 0; k < all->xel_count; k++) printf(" %d", (int)servo[all->p_xels[k].id].goal);
    printf("\n");
    return true;
  }
};
