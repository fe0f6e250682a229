"""Step a deck in a MuJoCo loop: the targets of servo20's servos, held at its root, and a switch after 2 s.

python examples/own_mujoco_loop.py
"""

import mujoco

import motiondeck

robot = motiondeck.load_robot("servo20")
deck = motiondeck.Deck("thesis15", "walk", robot=robot)
spec = mujoco.MjSpec.from_file(str(robot.model))
spec.delete(spec.joint("root"))
model = spec.compile()
data = mujoco.MjData(model)
while data.time < 4.0:
    if data.time > 2.0 and deck.status().motion == "walk":
        deck.switch("jog")
    data.ctrl[:] = deck.step(model.opt.timestep)  # one position servo for each of deck.joints
    mujoco.mj_step(model, data)
print(f"{deck.status().motion}: servos within {abs(data.actuator_length - data.ctrl).max():.2f} rad of their targets")
