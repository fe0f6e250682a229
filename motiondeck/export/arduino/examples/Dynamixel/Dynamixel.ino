// Drives the Dynamixel servos of the rig file, whose IDs, zeros and directions are in servos.h. Written for boards whose
// direction of the bus is switched by themselves, as the OpenRB-150's; for others give the pin.
// Commands come over USB, as `motiondeck send` spells them, e.g. "waltz", "tempo 0.5" or "estop"; "off" takes the torque
// off, "on" sets all up again where they stand. A computer that plays the board as a rig gives goals (goals.h), and is
// told what the servos measure.
// The servos stop by themselves if the board does: their bus watchdog is on.
#include <Dynamixel2Arduino.h>
#include <Motiondeck.h>

#define BUS Serial1
static const int DIRECTION_PIN = -1;
static const uint32_t PATIENCE = 3; // ms that a servo may take to answer

static Dynamixel2Arduino bus(BUS, DIRECTION_PIN);
static md_player player;
static md_goals goals;
static md_line line;
static uint32_t due; // us
static bool limp;
static int32_t pulses[SERVOS], measured[SERVOS];
static DYNAMIXEL::XELInfoSyncWrite_t pulses_of[SERVOS];
static DYNAMIXEL::InfoSyncWriteInst_t all_goals;
static DYNAMIXEL::XELInfoSyncRead_t measured_of[SERVOS];
static DYNAMIXEL::InfoSyncReadInst_t all_measured;

// Waits for a servo, sets it up without torque, and says where it stands, in pulses.
static int32_t prepared(const md_servo &servo) {
  uint8_t data[4];
  while (!bus.ping(servo.id)) {
    Serial.print("no answer from servo ");
    Serial.println(servo.id);
    delay(1000);
  }
  bus.torqueOff(servo.id);
  bus.writeControlTableItem(ControlTableItem::BUS_WATCHDOG, servo.id, 0); // one that has struck refuses goals until then
  bus.writeControlTableItem(ControlTableItem::OPERATING_MODE, servo.id, servo.mode);
  bus.writeControlTableItem(ControlTableItem::PROFILE_ACCELERATION, servo.id, 0);
  bus.writeControlTableItem(ControlTableItem::PROFILE_VELOCITY, servo.id, 0);
  while (bus.read(servo.id, SERVO_PRESENT, 4, data, sizeof data) != 4) delay(10);
  return (int32_t)((uint32_t)data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16 | (uint32_t)data[3] << 24);
}

static md_number angle_of(const md_servo &servo, int32_t position) {
  return MD((float)(position - servo.zero) / servo.per_radian);
}

static void set_goals(const md_number *angles) {
  for (int number = 0; number < SERVOS; number++) {
    const md_servo &servo = servos[number];
    pulses[number] = servo.zero + (int32_t)lroundf(MD_FLOAT(angles[servo.joint]) * servo.per_radian);
  }
  all_goals.is_info_changed = true;
  bus.syncWrite(&all_goals);
}

// Tells the computer what the servos measure. One that is silent ends the reading for those after it; the next begins there.
static void tell_measured() {
  md_number angles[FIGURE_JOINTS];
  uint8_t alerts[FIGURE_JOINTS] = {0};
  static int first;
  for (int joint = 0; joint < FIGURE_JOINTS; joint++) angles[joint] = MD_UNKNOWN;
  for (int k = 0; k < SERVOS; k++) {
    int number = (first + k) % SERVOS;
    measured_of[k].id = servos[number].id;
    measured_of[k].p_recv_buf = (uint8_t *)&measured[number];
    measured_of[k].error = 0;
  }
  all_measured.is_info_changed = true;
  int came = bus.syncRead(&all_measured, PATIENCE);
  for (int k = 0; k < came; k++) {
    int number = (first + k) % SERVOS;
    const md_servo &servo = servos[number];
    if (!servo.second) angles[servo.joint] = angle_of(servo, measured[number]);
    if (measured_of[k].error & 0x80) alerts[servo.joint] = 1;
  }
  if (came < SERVOS) first = (first + came + 1) % SERVOS;
  md_tell(&player, &goals, angles, alerts);
}

// Sets up the servos where they stand, and takes torque on.
static void start() {
  md_number angles[FIGURE_JOINTS] = {0};
  for (int number = 0; number < SERVOS; number++) {
    const md_servo &servo = servos[number];
    pulses[number] = prepared(servo);
    // The second servo of a joint is not asked: the first one says where the joint is.
    if (!servo.second) angles[servo.joint] = angle_of(servo, pulses[number]);
    pulses_of[number].id = servo.id;
    pulses_of[number].p_data = (uint8_t *)&pulses[number];
  }
  while (md_begin(&player, figure, angles) < 0) delay(1000); // a damaged figure plays nothing
  if (goals.taken) md_follow(&player, &goals, goals.within);
  all_goals.is_info_changed = true;
  bus.syncWrite(&all_goals); // first the goals, where the servos stand, then torque
  for (int number = 0; number < SERVOS; number++) {
    bus.torqueOn(servos[number].id);
    bus.writeControlTableItem(ControlTableItem::BUS_WATCHDOG, servos[number].id, SERVO_WATCHDOG);
  }
  due = micros();
}

void setup() {
  Serial.begin(MD_BAUD);
  bus.begin(SERVO_BAUD);
  bus.setPortProtocolVersion(2.0);
  all_goals.addr = SERVO_GOAL;
  all_goals.addr_length = 4;
  all_goals.p_xels = pulses_of;
  all_goals.xel_count = SERVOS;
  all_goals.packet.p_buf = NULL;
  all_goals.packet.is_completed = false;
  all_measured.addr = SERVO_PRESENT;
  all_measured.addr_length = 4;
  all_measured.p_xels = measured_of;
  all_measured.xel_count = SERVOS;
  all_measured.packet.p_buf = NULL;
  all_measured.packet.is_completed = false;
  start();
}

void loop() {
  md_take_lines(&player, &goals, &line, &due);
  if (limp != (bool)goals.off) {
    limp = goals.off;
    for (int number = 0; limp && number < SERVOS; number++) bus.torqueOff(servos[number].id);
    if (!limp) start();
  }
  if (!md_tick_is_due(&due)) return;
  const md_number *angles = md_step_towards(&player, &goals);
  if (!limp) set_goals(angles);
  if (goals.asked) tell_measured();
}
