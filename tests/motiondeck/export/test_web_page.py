"""The page of an export, in a browser: what it loads, how it plays, and where it draws a robot."""

import dataclasses
import importlib.util
import runpy
import shutil
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import msgspec
import mujoco
import numpy as np
import pytest
from playwright.sync_api import expect

from controller.deck.interfaces import JointLimits
from controller.deck.motion_generator import MotionGenerator
from controller.learning.trainers.clip import fitted_keys
from controller.library.motion_library import MotionLibrary, load_library, save_library
from controller.motion.encodings.joint_angles import JointAngles, JointBody
from controller.motion.encodings.robot_joints import RobotJoints
from controller.networks.centralized.centers import pairs_at
from controller.networks.clip.network import ClipPlayer
from controller.networks.keys import Keys
from controller.wire.messages.commands import Blend, EmergencyStop, Jump, Pause, Queue, Reset, Resume, SetTempo, Switch
from joint_libraries import centralized_library
from motiondeck.export.golden import deck_trace
from motiondeck.export.source import open_figure
from motiondeck.export.web_page import copy_player, drawn_figure, drawn_human, write_page
from motiondeck_base.shipped import find_library, find_robot
from sim.models.joint_layout import JointLayout
from sim.robots.robot import load_robot

DOCS = Path(__file__).parents[3] / "docs"
RATE, FRAMES = 100.0, 120.0
LENGTHS = {"stroll": 150, "turn": 220, "bow": 180}


def channels(name, frames, joints):
    """The channels of a motion that is made up: slow swings of all joints, and a root that goes and turns."""
    seconds, phase = np.arange(frames) / FRAMES, 2.0 * np.pi * np.arange(frames) / frames
    own = np.arange(joints) + 3.0 * len(name)
    if name == "bow":  # there and back
        angles = 0.2 * np.sin(own) * (1.0 - np.cos(phase))[:, None]
    else:
        angles = 0.15 * np.cos(phase[:, None] + own) + 0.05 * np.cos(2.0 * phase[:, None] - own)
    nod = 0.1 * np.sin(phase)
    axes = np.column_stack([np.cos(nod), 0.0 * nod, -np.sin(nod), 0.0 * nod, 1.0 + 0.0 * nod, 0.0 * nod])
    rates = np.column_stack([0.06 + 0.02 * np.sin(phase), 0.03 + 0.0 * seconds, 0.01 * np.cos(phase)])
    return np.column_stack([angles, rates, 0.25 + 0.01 * np.cos(phase), axes])


@pytest.fixture(scope="module")
def library():
    robot = load_robot(find_robot("servo20"), load_library(find_library("thesis15")).skeleton)
    encoding, shipped = RobotJoints.for_joints(robot.joints), load_library(find_library("thesis15")).info
    loops = {name: name != "bow" for name in LENGTHS}
    keys = {
        name: Keys.of(fitted_keys(channels(name, frames, 20), 4, loop=loops[name]), 0, 96)
        for name, frames in LENGTHS.items()
    }
    network = ClipPlayer.of_keys(keys, LENGTHS, loops)
    motions = [
        msgspec.structs.replace(shipped.motions[0], name=name, frames=frames, plays="loop" if loops[name] else "once")
        for name, frames in LENGTHS.items()
    ]
    skeleton = {"encoding": encoding.name, "skeleton": encoding.skeleton_info(), "network": "clip"}
    return MotionLibrary(msgspec.structs.replace(shipped, motions=motions, **skeleton), network, encoding)


@pytest.fixture(scope="module")
def robot(library):
    """servo20 with servos that nothing is too fast for: of limits the deck and the player have tests of their own."""
    robot = load_robot(find_robot("servo20"), library.skeleton)
    own = robot.limits
    fast = JointLimits(own.lower - 0.5, own.upper + 0.5, 8.0 * own.velocity, 40.0 * own.acceleration, 99.0 * own.jerk)
    return dataclasses.replace(robot, limits=fast)


@pytest.fixture(scope="module")
def exported(library, robot, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return folder, write_page(folder, library, robot, RATE, groups={"head": robot.joints[:2]})


@pytest.fixture(scope="module")
def address(exported):
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=exported[0]))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()


@pytest.fixture(scope="module")
def open_page(browser, address):
    page = browser.new_page(viewport={"width": 700, "height": 700})
    page.goto(address)
    page.wait_for_function("motiondeck.page?.frames > 1")
    yield page
    page.close()


@pytest.fixture
def first_page_of_the_docs(tmp_path):
    copy_player(tmp_path)
    shutil.copy(DOCS / "live/figure.js", tmp_path)
    return tmp_path.as_uri() + "/"


@pytest.mark.parametrize("way", ["server", "disk", "docs"])
def test_page_loads_from_its_own_folder_alone(browser, address, exported, first_page_of_the_docs, way):
    base = {"server": address, "disk": exported[0].as_uri() + "/", "docs": first_page_of_the_docs}[way]
    page, asked, problems = browser.new_page(), [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: message.type == "error" and problems.append(message.text))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(f"{base}index.html")
    page.wait_for_function("motiondeck.page?.frames > 1")
    expect(page.locator("#state b")).to_have_text("PLAYING")
    page.close()
    assert problems == []
    outside = [url for url in asked if not url.startswith((base, "data:"))]
    assert outside == []
    assert len(asked) > 5
    assert sum(file.stat().st_size for file in exported[0].iterdir()) < 2e6


def test_keys_buttons_and_the_state_line(browser, address):
    page = browser.new_page()
    page.goto(address)
    page.wait_for_function("motiondeck.page?.frames > 1")
    word = page.locator("#state b")
    page.keyboard.press("2")
    page.wait_for_function("motiondeck.page.player.playing === 1")
    page.locator(".later").nth(2).click()
    page.wait_for_function("document.querySelector('#queue').textContent === 'next: bow'")
    for _ in range(2):  # a key that is held: it repeats
        page.keyboard.down("Space")
    page.keyboard.up("Space")
    expect(word).to_have_text("PAUSED")
    page.keyboard.press("Space")
    page.wait_for_function("!motiondeck.page.player.paused")
    page.keyboard.press("Escape")
    page.wait_for_function("document.querySelector('#state b').textContent === 'STOPPED'")
    page.locator(".play").nth(0).click()
    page.wait_for_timeout(300)
    expect(word).to_have_text("STOPPED")  # latched
    page.locator("#stop").click()
    page.wait_for_function("document.querySelector('#state b').textContent === 'HELD'")
    page.locator(".play").nth(0).click()
    page.wait_for_function("document.querySelector('#state b').textContent === 'PLAYING'", timeout=60000)
    page.locator("#pause").focus()
    page.keyboard.press("Space")  # presses the button, and no more
    page.wait_for_function("document.querySelector('#state b').textContent === 'PAUSED'")
    for _ in range(2):
        page.keyboard.down("Enter")
    page.keyboard.up("Enter")
    page.wait_for_function("!motiondeck.page.player.paused")
    page.close()


def test_blend_layers_single_joints_and_the_ring(browser, address):
    page = browser.new_page()
    page.goto(address)
    page.wait_for_function("motiondeck.page?.frames > 1")
    player, passed = "motiondeck.page.player", "motiondeck.page.player.advance(4)"
    page.evaluate(passed)  # the approach
    page.locator("summary").click()
    page.locator("#with").select_option("turn")
    page.evaluate(passed)
    assert [weight for _, weight, _ in page.evaluate(f"{player}.blended")] == [0.5, 0.5]
    page.wait_for_function(
        "document.querySelector('#state span').textContent === 'stroll 50 %, turn 50 %'", timeout=60000
    )
    page.locator("#with").select_option("nothing")
    page.evaluate(passed)
    assert [weight for _, weight, _ in page.evaluate(f"{player}.blended")] == [1.0]
    page.locator("#over").select_option("turn")
    page.evaluate(passed)
    [[motion, share]] = page.evaluate(f"{player}.layers")
    assert (motion, share) == (1, 1.0)
    page.locator("#over").select_option("nothing")
    page.evaluate(passed)
    assert page.evaluate(f"{player}.layers") == []
    before = page.evaluate(f"{player}.targets[0]")
    page.locator("#value").press("End")
    page.evaluate(passed)
    assert page.evaluate(f"[{player}.live.join(), {player}.targets[0] > {before} + 0.5]") == ["0", True]
    page.wait_for_function("!document.getElementById('release').disabled", timeout=60000)
    page.locator("#release").click()
    page.evaluate(passed)
    assert page.evaluate(f"{player}.live") == []
    page.evaluate("motiondeck.page.player.jump = (phase) => (window.jumped = phase)")
    ring = page.locator("#ring")
    ring.scroll_into_view_if_needed()
    box = ring.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 6)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] - 6, box["y"] + 0.5 * box["height"])
    assert page.evaluate("window.jumped ?? null") is None  # it only aims
    page.mouse.up()
    assert abs(page.evaluate("window.jumped") - 0.25) < 0.01
    page.close()


HUMAN = """([drawing, motions, course]) => {
  const human = new motiondeck.Human(drawing, motiondeck.page.figure, motions, [true, false]);
  const shown = course.map((one) => human.bodies(one, [[3, 5, 0], [1, 0, 0, 0]], 0));
  return [human.size, human.aside, ...shown.map((bodies) => human.figure.bodies.map((_, body) => bodies[body][0]))];
}"""


def test_human_stands_beside_the_robot_as_the_library_has_it(open_page):
    library = load_library(find_library("thesis15"))
    skeleton, rate, motions = library.skeleton, library.info.rate, ["walk", "standup"]
    drawing, expected, course = drawn_human(library, motions), [], []
    for playing, frame in ((0, 0), (0, 91), (0, 244), (1, 172), (1, 344)):
        info = library.info.motions[[one.name for one in library.info.motions].index(motions[playing])]
        frames = MotionGenerator(library, info.name).frames(info.frames / rate, rate)
        posture = library.encoding.decode(frames)
        phase = frame / (info.frames - playing)
        ends = skeleton.joints(np.zeros(3), posture.rotation[frame])
        expected.append(np.array([ends[1 + parent] for parent in skeleton.parent]))
        course.append({"playing": playing, "phase": phase, "beside": [], "fade": 0.0})
    course += [{**course[0], "fade": fade} for fade in (0.9, 0.0)]  # a fade begins where it was
    course.append({**course[1], "beside": [[0, 1.0, course[2]["phase"]]]})
    size, aside, *shown = open_page.evaluate(HUMAN, [drawing, motions, course])
    places = np.array(shown)[:, drawing["turned"]]
    bones = (places[:, 1:] - places[:, :1]) / size
    assert np.abs(bones[:5] - np.array(expected)).max() < 0.015  # m, between samples
    assert np.allclose(places[5], places[4], atol=1e-6)
    assert np.abs(places[6] - places[4]).max() > 0.1 * size
    assert np.allclose(places[7], places[2], atol=1e-6)  # all of the weight is beside
    assert np.allclose(places[:, 0, :2], [3.0, 5.0 - aside])
    lowest = np.array(shown)[:4, drawing["turned"], 2].min(axis=1) / size
    assert ((lowest > -0.05) & (lowest < 0.2)).all()


SCRIPTED = """async ([script, ticks]) => {
  const player = await motiondeck.load(motiondeck.figure.words, motiondeck.page.figure.start);
  const trace = [[...player.targets]], answers = [];
  for (let tick = 1; tick < ticks; tick++) {
    for (const [due, name, ...given] of script) if (due === tick) answers.push(player[name](...given) ?? 0);
    trace.push([...player.step()]);
  }
  return [trace, answers];
}"""


@pytest.mark.thorough
def test_a_scripted_minute_is_that_of_the_deck(exported, open_page):
    figure, rng, ticks = exported[1], np.random.default_rng(46), 6000
    script, commands = [], []
    for tick in np.sort(rng.choice(np.arange(50, 5800), 30, replace=False)).tolist():
        motion, tempo = int(rng.integers(3)), float(np.float32(rng.uniform(-1.0, 2.0)))
        phase, direct = float(np.float32(rng.random())), bool(rng.random() < 0.3)
        name, other = [*LENGTHS][motion], int(rng.integers(3))
        weight = float(np.float32(rng.uniform(-0.3, 1.3)))
        choices = [
            [("switch", Switch(name, direct), motion, direct)],
            [("queue", Queue(name), motion)],
            [("tempo", SetTempo(tempo), tempo)],
            [("jump", Jump(phase), phase)],
            [("blend", Blend(name, [*LENGTHS][other], weight), motion, other, weight)],
            [("pause", Pause()), ("resume", Resume())],
            [("stop", EmergencyStop()), ("reset", Reset()), ("resume", Resume())],
        ]
        for later, (way, command, *given) in enumerate(choices[rng.integers(len(choices))]):
            script.append([tick + 70 * later, way, *given])
            commands.append((tick + 70 * later, command))
    script.sort(key=lambda row: row[0])
    commands.sort(key=lambda row: row[0])
    trace, answers = open_page.evaluate(SCRIPTED, [script, ticks])
    expected = deck_trace(figure, commands, ticks)
    assert [answer == 0 for answer in answers] == expected.accepted
    assert np.abs(np.array(trace) - expected.safe).max() < 1e-3
    assert np.ptp(expected.safe, axis=0).max() > 0.3


def test_the_root_goes_where_the_motion_goes(open_page):
    place, _ = open_page.evaluate(
        """async () => {
          const player = await motiondeck.load(motiondeck.figure.words, motiondeck.page.figure.start);
          for (let tick = 0; tick < 500; tick++) player.step();
          return player.posture[1];
        }"""
    )
    # By the motion's own frames: 501 ticks at 100 Hz are 601.2 frames.
    x = y = heading = 0.0
    rows = channels("stroll", LENGTHS["stroll"], 20)
    for frame in range(601):
        turn_rate, forward, left = 10.0 * rows[frame % 150, 20:23]
        heading += turn_rate / FRAMES
        x += (np.cos(heading) * forward - np.sin(heading) * left) / FRAMES
        y += (np.sin(heading) * forward + np.cos(heading) * left) / FRAMES
    assert np.hypot(place[0] - x, place[1] - y) < 0.02 * np.hypot(x, y)


@pytest.mark.thorough
def test_satellites_are_shown_as_they_respond(browser, robot, tmp_path):
    made, encoding = centralized_library(len(robot.joints)), JointAngles(JointBody.of(robot.joints))
    library = MotionLibrary(
        msgspec.structs.replace(made.info, skeleton=encoding.skeleton_info()), made.network, encoding
    )
    figure = write_page(tmp_path, library, robot, RATE, networks=True)
    assert set(figure.held.values()) == {"network"}
    page = browser.new_page()
    page.goto(tmp_path.as_uri() + "/index.html")
    parts = [made.network[name] for name in made.network.motions]
    words = f"{len(parts[0].satellites.places)} satellites of loop0"
    strip = page.get_by_role("img", name="what each satellite of the network responds", exact=True)
    strip.get_by_text(words, exact=True).wait_for()
    for motion, part in enumerate(parts):
        for phase in (0.0, 0.21, 0.7, 1.0):
            found = page.evaluate(f"motiondeck.page.player.responses({motion}, {phase})")
            # A round of a one-shot is its last frame.
            states = pairs_at(part.frequency, part.phase, np.array([phase * part.seconds]))
            assert np.abs(found - part.satellites.respond(states)[0]).max() < 2e-4
    rows = page.evaluate(
        """() => {
          const canvas = document.querySelector("#network canvas");
          motiondeck.bars(canvas, [0, 1, 0.5]);
          const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
          const filled = (x) => [...Array(canvas.height).keys()].filter((y) => data[4 * (canvas.width * y + x) + 3]);
          return [1, 9, 17].map((x) => filled(x).length / canvas.height);
        }"""
    )
    assert rows == [0.0, 1.0, 0.5]
    page.close()


def test_a_page_of_keys_shows_no_satellites(open_page):
    open_page.locator("#network").wait_for(state="hidden")
    assert open_page.evaluate("motiondeck.page.player.responses(0, 0.5)") == []


PIXELS = """([steps, pictures]) => {
  const pixels = new motiondeck.Pixels(steps), levels = [[0, 0]];
  let now = 0;
  for (const [seconds, cost] of pictures)
    for (const end = now + seconds; now < end; ) {
      const passed = Math.ceil(60 * cost * pixels.share ** 2) / 60; // pictures wait for the screen
      pixels.shown(passed);
      now += passed;
      if (pixels.level !== levels.at(-1)[1]) levels.push([now, pixels.level]);
    }
  return [...levels, [now, -1]];
}"""


@pytest.mark.parametrize(("cost", "settles"), [(0.016, 0), (0.03, 2), (0.1, 4)])
def test_pixels_become_fewer_until_pictures_keep_up(open_page, cost, settles):
    times, levels = np.array(open_page.evaluate(PIXELS, [4, [(600.0, cost)]])).T
    assert (times[1:] > 1.0).all()  # the first second is slow for other reasons
    kept = np.diff(times)
    assert kept[levels[:-1] == settles].sum() > 0.98 * 600.0
    assert len(kept) < 24  # each try waits twice as long
    assert len(open_page.evaluate(PIXELS, [0, [(60.0, cost)]])) == 2  # with a graphics card


def test_pixels_come_back_when_the_computer_has_time_again(open_page):
    levels = np.array(open_page.evaluate(PIXELS, [4, [(20.0, 0.1), (60.0, 0.01)]]))[:-1, 1].astype(int).tolist()
    assert levels == [0, 1, 2, 3, 4, 3, 2, 1, 0]


GRIPPER = """<mujoco><worldbody><body name="base" pos="0 0 0.3"><freejoint/><geom size="0.05"/>
  <body name="arm" pos="0.1 0 0.1" quat="0.9 0.1 0.4 0.1"><geom size="0.02 0.1" type="capsule"/>
    <joint name="shoulder" axis="0 1 0" pos="0.03 0.01 -0.02"/><joint name="roll" axis="1 0 0.2" pos="0 0.02 0.01"/>
    <body name="left" pos="0 -0.05 0.2"><geom size="0.01"/><joint name="left" type="slide" axis="0 1 0"/></body>
    <body name="right" pos="0 0.05 0.2"><geom size="0.01"/><joint name="right" axis="0 0 1" pos="0.01 0 0"/></body>
    <body name="thumb" pos="0.1 0 0.2"><geom size="0.01"/><joint name="thumb" axis="0 0 1" pos="0.01 0 0"/></body>
  </body></body></worldbody>
  <equality><joint joint1="left" joint2="right" polycoef="0.01 0.2 0.1 0 0"/>
    <joint joint1="thumb" polycoef="0.4 0 0 0 0"/></equality>
  <actuator><position joint="roll"/><position joint="shoulder"/><position joint="right"/></actuator></mujoco>"""


@pytest.mark.parametrize("kind", ["servo20", "gripper"])
def test_bodies_are_where_mujoco_has_them(robot, open_page, kind):
    rng, model, layout = np.random.default_rng(1), robot.drawn, robot.layout
    if kind == "gripper":
        model = mujoco.MjModel.from_xml_string(GRIPPER)
        layout = JointLayout.of(model)
        assert layout.led
    data, drawing = mujoco.MjData(model), drawn_figure(model, layout)
    for _ in range(5):
        targets = rng.uniform(-1.5, 1.5, len(layout.joints))
        layout.place(targets, data.qpos)
        data.qpos[:7] = [*rng.normal(size=3), *(turn := rng.normal(size=4)) / np.linalg.norm(turn)]
        mujoco.mj_kinematics(model, data)
        root = [data.qpos[:3].tolist(), data.qpos[3:7].tolist()]
        found = open_page.evaluate(
            "([drawing, root, angles]) => motiondeck.placed(motiondeck.figureOf(drawing), root, angles)",
            [drawing, root, targets.tolist()],
        )
        places, turns = zip(*found, strict=True)
        assert np.allclose(places, data.xpos, atol=1e-5)
        assert np.allclose(np.abs(np.sum(np.array(turns) * data.xquat, axis=1)), 1.0, atol=1e-6)


def test_what_was_baked_for_a_robot_plays_on_a_rig_with_its_joints(library, tmp_path):
    save_library(library, tmp_path / "baked.safetensors")
    figure = open_figure(str(tmp_path / "baked.safetensors"), None, "servo20", ["turn"], tmp_path / "page")
    assert len(figure.rest) == 20


PLAYER_WASM = runpy.run_path(str(DOCS / "player_wasm.py"))


def test_player_wasm_was_made_from_the_player_as_it_is():
    assert PLAYER_WASM["PLAYER"].read_bytes().endswith(PLAYER_WASM["digest_section"]()), "run docs/player_wasm.py"


@pytest.mark.thorough
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang compiles it")
def test_player_wasm_is_the_same_when_made_again():
    assert PLAYER_WASM["compiled"]() == PLAYER_WASM["PLAYER"].read_bytes()
