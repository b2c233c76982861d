#!/usr/bin/python3
"""The installed package: complete, working as the devel space does, and its layers usable by another package."""

import os
import shutil
import subprocess
import tempfile
import unittest

BUILD = os.environ.get('SCKF_BUILD_DIR', '')
HERE = os.path.dirname(os.path.abspath(__file__))


def run(*command) -> str:
    """In a shell as a login finds it, without the devel space that the tests run in."""
    environment = {'PATH': '/usr/bin:/bin', 'HOME': tempfile.gettempdir()}
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    if result.returncode != 0:
        raise AssertionError('%s\n%s' % (' '.join(command), result.stdout[-4000:]))
    return result.stdout


@unittest.skipUnless(BUILD, 'SCKF_BUILD_DIR does not name the folder of the build')
class Install(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        # catkin fixes the prefix when it configures; scripts/setup puts it into the build.
        cls.prefix = os.path.join(os.path.realpath(BUILD), '.install')
        with open(os.path.join(BUILD, 'CMakeCache.txt'), encoding='utf-8') as file:
            cache = file.read()
        if 'CMAKE_INSTALL_PREFIX:PATH=%s\n' % cls.prefix not in cache:
            raise unittest.SkipTest('not configured to install into %s' % cls.prefix)
        shutil.rmtree(cls.prefix, ignore_errors=True)
        run('cmake', '--install', BUILD)

    def in_the_installed_space(self, command: str) -> str:
        return run('bash', '-c', '. %s/setup.bash && %s' % (self.prefix, command))

    def test_everything_is_there(self):
        share = 'share/sckf_odometry/'
        for name in ('lib/libsckf_odometry_core.so', 'lib/libsckf_odometry_ros.so', 'lib/sckf_odometry/replay',
                     'lib/sckf_odometry/sckf_odometry_node', 'lib/sckf_odometry/rawlog_to_bag',
                     'lib/sckf_odometry/calibrate_odometry', 'lib/sckf_odometry/consistency',
                     'lib/sckf_odometry/evaluate',
                     'lib/sckf_odometry/pairs', 'lib/sckf_odometry/plot',
                     share + 'package.xml',
                     share + 'nodelet_plugins.xml', share + 'launch/sckf_odometry.launch',
                     share + 'launch/replay.launch', share + 'config/sckf_odometry.yaml',
                     share + 'config/live.rviz', share + 'config/debug.rviz',
                     share + 'config/compare.rviz', 'include/sckf_odometry/core/se2.h'):
            self.assertTrue(os.path.exists(os.path.join(self.prefix, name)), name)

    def test_the_package_and_its_nodelet_are_found_there(self):
        self.assertEqual(self.in_the_installed_space('rospack find sckf_odometry').strip(),
                         self.prefix + '/share/sckf_odometry')
        plugins = self.in_the_installed_space('rospack plugins --attrib=plugin nodelet')
        self.assertIn(self.prefix + '/share/sckf_odometry/nodelet_plugins.xml', plugins)

    def test_its_messages_are_there_in_both_languages(self):
        for name in ('Status', 'SetPose'):
            self.assertTrue(os.path.exists('%s/include/sckf_odometry/%s.h' % (self.prefix, name)), name)
        modules = self.in_the_installed_space(
            'python3 -c "from sckf_odometry import msg, srv; print(msg.Status()); print(srv.SetPose, msg.__file__)"')
        self.assertIn('reference_age: 0.0', modules)
        self.assertIn(self.prefix, modules)

    def test_the_tools_run_from_there(self):
        for tool in ('replay', 'rawlog_to_bag', 'calibrate_odometry', 'consistency', 'evaluate', 'pairs', 'plot',
                     'experiment', 'experiment_data'):
            self.assertIn('usage', self.in_the_installed_space('rosrun sckf_odometry %s --help' % tool))

    def test_nothing_points_back_to_the_build(self):
        for tool in ('replay', 'sckf_odometry_node'):
            libraries = self.in_the_installed_space('ldd %s/lib/sckf_odometry/%s' % (self.prefix, tool))
            ours = [line for line in libraries.splitlines() if 'sckf_odometry_' in line]
            self.assertTrue(ours, libraries)
            for line in ours:
                self.assertIn(self.prefix, line)

    def test_another_package_links_the_core(self):
        with tempfile.TemporaryDirectory() as build:
            run('cmake', '-S', HERE + '/consumer', '-B', build, '-DCMAKE_PREFIX_PATH=' + self.prefix)
            run('cmake', '--build', build)
            libraries = run('ldd', build + '/consumer')
            self.assertIn(self.prefix + '/lib/libsckf_odometry_core.so', libraries)
            self.assertNotIn('mrpt', libraries)
            self.assertEqual(run(build + '/consumer').strip(), '0.5')

    def test_another_package_of_ros_links_all_layers(self):
        with tempfile.TemporaryDirectory() as build:
            self.in_the_installed_space('cmake -S %s/catkin_consumer -B %s && cmake --build %s' % (HERE, build, build))
            self.assertEqual(self.in_the_installed_space(build + '/catkin_consumer').strip(), '0.5')


if __name__ == '__main__':
    unittest.main()
