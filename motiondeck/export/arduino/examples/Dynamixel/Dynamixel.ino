// Drives the Dynamixel servos of the rig file, whose IDs, zeros and directions are in servos.h. Written for boards whose
// direction of the bus is switched by themselves, as the OpenRB-150's; for others give the pin.
// Commands come over USB, as `motiondeck send` spells them, e.g. "waltz", "tempo 0.5" or "estop".
// The servos stop by themselves if the board does: their bus watchdog is on.
#include <Dynamixel2Arduino.h>
#include <Motiondeck.h>

#define BUS Serial1
static const int DIRECTION_PIN = -1;

static Dynamixel2Arduino bus(BUS, DIRECTION_PIN);
static md_player player;
static md_line line;
static uint32_t due; // us
static int32_t goals[SERVOS];
static DYNAMIXEL::XELInfoSyncWrite_t goal_of[SERVOS];
static DYNAMIXEL::InfoSyncWriteInst_t all_goals;

// Waits for a servo, sets it up without torque, and says where it stands, in pulses.
static int32_t prepared(const md_servo &servo) {
  uint8_t data[4];
  while (!bus.ping(servo.id)) {
    Serial.print("no answer from servo ");
    Serial.println(servo.id);
    delay(1000);
  }
  bus.torqueOff(servo.id);
  bus.writeControlTableItem(ControlTableItem::OPERATING_MODE, servo.id, servo.mode);
  bus.writeControlTableItem(ControlTableItem::PROFILE_ACCELERATION, servo.id, 0);
  bus.writeControlTableItem(ControlTableItem::PROFILE_VELOCITY, servo.id, 0);
  while (bus.read(servo.id, SERVO_PRESENT, 4, data, sizeof data) != 4) delay(10);
  return (int32_t)((uint32_t)data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16 | (uint32_t)data[3] << 24);
}

static void set_goals(const float *angles) {
  for (int number = 0; number < SERVOS; number++) {
    const md_servo &servo = servos[number];
    goals[number] = servo.zero + (int32_t)lroundf(angles[servo.joint] * servo.per_radian);
  }
  all_goals.is_info_changed = true;
  bus.syncWrite(&all_goals);
}

void setup() {
  float measured[FIGURE_JOINTS] = {0};
  Serial.begin(115200);
  bus.begin(SERVO_BAUD);
  bus.setPortProtocolVersion(2.0);
  for (int number = 0; number < SERVOS; number++) {
    const md_servo &servo = servos[number];
    goals[number] = prepared(servo);
    // The second servo of a joint is not asked: the first one says where the joint is.
    if (!servo.second) measured[servo.joint] = (float)(goals[number] - servo.zero) / servo.per_radian;
    goal_of[number].id = servo.id;
    goal_of[number].p_data = (uint8_t *)&goals[number];
  }
  all_goals.addr = SERVO_GOAL;
  all_goals.addr_length = 4;
  all_goals.p_xels = goal_of;
  all_goals.xel_count = SERVOS;
  all_goals.packet.p_buf = NULL;
  all_goals.packet.is_completed = false;
  all_goals.is_info_changed = true;
  while (md_begin(&player, figure, measured) < 0) delay(1000); // a damaged figure plays nothing
  bus.syncWrite(&all_goals); // first the goals, where the servos stand, then torque
  for (int number = 0; number < SERVOS; number++) {
    bus.torqueOn(servos[number].id);
    bus.writeControlTableItem(ControlTableItem::BUS_WATCHDOG, servos[number].id, SERVO_WATCHDOG);
  }
  due = micros();
}

void loop() {
  md_take_commands(&player, &line);
  if (!md_tick_is_due(&due)) return;
  set_goals(md_step(&player));
}
