#!/usr/bin/python3
"""Node and nodelet under valgrind, while they work and while they end: no invalid access, no memory lost."""

import os
import shutil
import signal
import subprocess
import tempfile
import unittest

import roslib.packages
import rospy

import junit_runner
import run_helpers as helpers
import simulated_bag

SUPPRESSIONS = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, 'sanitizers', 'valgrind.supp')
ERROR = 99  # exit code of valgrind if it has found any
VALGRIND = ['valgrind', '--error-exitcode=%d' % ERROR, '--leak-check=full', '--show-leak-kinds=definite',
            '--errors-for-leak-kinds=definite', '--num-callers=40', '--gen-suppressions=all', '--suppressions=' + SUPPRESSIONS]
NODELET = 'sckf_odometry/ScKfOdometryNodelet'


def program(package, name):
    return roslib.packages.find_node(package, name)[0]


@unittest.skipUnless(shutil.which('valgrind'), 'valgrind is not installed')
class Valgrind(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.messages = simulated_bag.messages(duration=8.0)
        cls.last = [stamp for topic, _, stamp in cls.messages if topic == '/odom'][-1]

    def setUp(self):
        self.log = tempfile.NamedTemporaryFile('r', suffix='.valgrind')
        self.processes = []

    def tearDown(self):
        for process in self.processes:
            process.kill()
            process.wait()
        self.log.close()

    def start(self, *command):
        self.processes.append(subprocess.Popen(command))
        return self.processes[-1]

    def start_watched(self, *command):
        return self.start(*VALGRIND, '--log-file=' + self.log.name, *command)

    def drive(self):
        """A robot's few seconds, until the last of them is estimated."""
        recorder = helpers.Recorder()
        helpers.wait_for_subscriber('/scan')
        helpers.Feeder(['/odom', '/scan', '/tf_static']).feed(self.messages, speed=2.0)
        helpers.wait_until(lambda: recorder.newest_stamp('odometry/filtered') >= self.last - 1e-6, 'the last odometry')
        self.assertGreater(len(recorder.messages('pose')), 20)

    def ends_clean(self, process, by=signal.SIGINT):
        process.send_signal(by)
        code = process.wait(timeout=helpers.TIMEOUT)
        with open(self.log.name, encoding='utf-8') as log:
            text = log.read()
        self.assertIn('ERROR SUMMARY', text)
        self.assertEqual(code, 0, text[-20000:])

    def test_the_node(self):
        node = self.start_watched(program('sckf_odometry', 'sckf_odometry_node'), '__name:=sckf_odometry')
        self.drive()
        self.ends_clean(node)

    def test_a_nodelet_that_is_unloaded(self):
        manager = self.start_watched(program('nodelet', 'nodelet'), 'manager', '__name:=manager')
        loader = self.start(program('nodelet', 'nodelet'), 'load', NODELET, 'manager', '__name:=sckf_odometry')
        self.drive()
        loader.send_signal(signal.SIGINT)
        loader.wait(timeout=helpers.TIMEOUT)
        helpers.wait_until(lambda: helpers.subscribers('/scan') == 0, 'the end of the nodelet')
        self.ends_clean(manager)

    def test_a_manager_that_ends_with_the_nodelet_in_it(self):
        manager = self.start_watched(program('nodelet', 'nodelet'), 'manager', '__name:=manager')
        self.start(program('nodelet', 'nodelet'), 'load', NODELET, 'manager', '__name:=sckf_odometry')
        self.drive()
        self.ends_clean(manager)


if __name__ == '__main__':
    rospy.init_node('test_valgrind')
    junit_runner.run(Valgrind)
