#!/usr/bin/python3
"""The views in rviz: each is opened as a person opens it, a bag is played, and what has to be in the picture is counted
by its colours. Nothing of it is there before the bag, nor without the nodelet.
"""

import os
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import numpy as np
import rospkg
import rospy
import yaml

import junit_runner
import run_helpers as helpers
import simulated_bag

WIDTH, HEIGHT = 1400, 900  # of the window, see the configurations
TOLERANCE = 30  # of red, green and blue
PATIENCE = 60.0  # [s] until everything is drawn, on a machine without a graphics card
CONFIG = os.path.join(rospkg.RosPack().get_path('sckf_odometry'), 'config')

# Of each view the displays, or markers, that have to be in it, and of how many pixels at least: half of what is usual.
EXPECTED = {
    'live': {'Estimate': 200, 'Wheels alone': 50, 'Cloud': 120, 'Scan': 500},
    'debug': {'Estimate': 500, 'Reference scan': 1700, 'Scan at estimate': 700, 'pairs': 200, 'covariance': 15},
    'compare': {'Estimate': 200, 'Cloud': 500, 'Other odometry': 20, 'Other path': 40},
}
MARKERS = {'pairs': (61, 230, 61), 'covariance': (199, 120, 255)}  # as in src/ros/debug_markers.cpp
ERROR = (192, 32, 32)  # in which rviz writes the name of a display that has an error


class Display:
    """An X server in memory, on a number that is free."""

    def __init__(self):
        reading, writing = os.pipe()
        self._server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(writing), '-screen', '0', '%dx%dx24' % (WIDTH, HEIGHT), '-nolisten', 'tcp'],
            pass_fds=[writing], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(writing)
        with os.fdopen(reading) as number:
            self.name = ':' + number.readline().strip()
        if self.name == ':':
            raise RuntimeError('Xvfb did not start')

    def picture(self):
        """height x width x 3."""
        return np.frombuffer(self._import('rgb:-'), np.uint8).reshape(HEIGHT, WIDTH, 3)

    def save(self, path):
        self._import(path)

    def _import(self, output):
        command = ['import', '-display', self.name, '-window', 'root', '-depth', '8', output]
        return subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout

    def close(self):
        self._server.terminate()
        self._server.wait()


def near(picture, colour, tolerance=TOLERANCE):
    return (np.abs(picture.astype(int) - colour) <= tolerance).all(axis=2)


class View:
    """What a configuration of rviz says of colours, and what a picture has of them."""

    def __init__(self, name):
        self.file = os.path.join(CONFIG, name + '.rviz')
        with open(self.file, encoding='utf-8') as file:
            manager = yaml.safe_load(file)['Visualization Manager']
        self.background = self._colour(manager['Global Options']['Background Color'])
        self.expected = EXPECTED[name]
        self.colours = dict(MARKERS)
        for display in manager['Displays']:
            text = display.get('Color') or display.get('Shape', {}).get('Color')
            if text:
                self.colours[display['Name']] = self._colour(text)

    @staticmethod
    def _colour(text):
        return tuple(int(part) for part in text.split(';'))

    def area(self, picture):
        """Rows and columns of the view: mostly background. None if there is none yet."""
        ground = near(picture, self.background, 0)
        rows, columns = np.flatnonzero(ground.mean(axis=1) > 0.3), np.flatnonzero(ground.mean(axis=0) > 0.3)
        return (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)) if len(rows) and len(columns) else None

    def count(self, picture):
        """Pixels in the colour of each thing that is expected."""
        area = self.area(picture)
        return {name: 0 if area is None else int(near(picture[area], self.colours[name]).sum())
                for name in self.expected}

    def shows_error(self, picture):
        panel = picture[:, :self.area(picture)[1].start]
        return near(panel, ERROR, 0).any()

    def missing(self, picture):
        return ['%s: %d pixels of at least %d' % (name, pixels, self.expected[name])
                for name, pixels in self.count(picture).items() if pixels < self.expected[name]]


@unittest.skipUnless(all(shutil.which(program) for program in ('rviz', 'Xvfb', 'import')),
                     'rviz, Xvfb or import (imagemagick) is not installed; scripts/setup --test installs them')
class Views(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.bag = os.path.join(cls.folder.name, 'drive.bag')
        simulated_bag.write(cls.bag, duration=30.0)
        # However long a message takes on a slow machine: at this rate it is long in the bag's time.
        cls.parameters = os.path.join(cls.folder.name, 'parameters.yaml')
        with open(cls.parameters, 'w', encoding='utf-8') as file:
            file.write('max_scan_delay: 10000\n')
        cls.display = Display()

    @classmethod
    def tearDownClass(cls):
        cls.display.close()
        cls.folder.cleanup()

    def start(self, *command):
        environment = dict(os.environ, DISPLAY=self.display.name, LIBGL_ALWAYS_SOFTWARE='1',
                           XDG_RUNTIME_DIR=self.folder.name)
        self.said = tempfile.TemporaryFile('w+')
        self.process = subprocess.Popen(command, env=environment, stdout=self.said, stderr=subprocess.STDOUT)
        self.addCleanup(self.said.close)
        self.addCleanup(self.process.wait)
        self.addCleanup(self.process.send_signal, signal.SIGINT)

    def saved_picture(self, name):
        path = '/tmp/sckf_odometry_%s.png' % name
        self.display.save(path)
        return path

    def wait_until(self, condition, what):
        def holds():
            if self.process.poll() is not None:
                raise AssertionError('waited for %s, but the program has ended' % what)
            return condition()
        try:
            helpers.wait_until(holds, what)
        except AssertionError as error:
            self.said.seek(0)
            self.fail('%s; see %s. The program says: %s'
                      % (error, self.saved_picture('waiting'), self.said.read()[-2000:]))

    def play_into(self, view):
        """The bag, into an rviz that runs and shows nothing yet."""
        self.wait_until(lambda: helpers.subscribers('/path') > 0, 'rviz')
        self.wait_until(lambda: view.area(self.display.picture()) is not None, 'a picture of rviz')
        self.assertFalse(any(view.count(self.display.picture()).values()), view.count(self.display.picture()))
        helpers.play(self.bag, rate=10)

    def check(self, name):
        view = View(name)
        self.start('roslaunch', 'sckf_odometry', 'sckf_odometry.launch', 'rviz:=' + name, 'params:=' + self.parameters)
        self.wait_until(lambda: helpers.subscribers('/odom') > 0, 'the nodelet')
        self.play_into(view)
        end = time.time() + PATIENCE
        while view.missing(self.display.picture()) and time.time() < end:
            time.sleep(0.5)
        picture = self.display.picture()
        missing = view.missing(picture)
        self.assertEqual(missing, [], 'see ' + self.saved_picture(name) if missing else None)
        self.assertFalse(view.shows_error(picture), 'rviz says that a display has an error')

    def test_live(self):
        self.check('live')

    def test_debug(self):
        self.check('debug')

    def test_compare(self):
        self.check('compare')

    def test_without_the_nodelet_there_is_nothing(self):
        view = View('debug')
        self.start('rosrun', 'rviz', 'rviz', '-d', view.file)
        self.play_into(view)
        time.sleep(2.0)  # for rviz to draw what it may have got
        self.assertFalse(any(view.count(self.display.picture()).values()), view.count(self.display.picture()))


if __name__ == '__main__':
    rospy.init_node('test_views')
    junit_runner.run(Views)
