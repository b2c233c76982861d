"""Runs a test node for rostest. Its own runner would count a skipped case as passed."""

import sys
import time
import unittest
import xml.etree.ElementTree as ElementTree


class _Result(unittest.TextTestResult):
    """Prints as usual, and keeps a JUnit element for every case."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.suite = ElementTree.Element('testsuite')
        self._begin = time.time()

    def startTest(self, test):
        self._begin = time.time()
        super().startTest(test)

    def _add(self, test, kind='', text=''):
        class_name, _, name = test.id().rpartition('.')
        case = ElementTree.SubElement(self.suite, 'testcase', classname=class_name, name=name,
                                      time='%.3f' % (time.time() - self._begin))
        if kind:
            ElementTree.SubElement(case, kind, message=text.strip().split('\n')[-1]).text = text

    def addSuccess(self, test):
        super().addSuccess(test)
        self._add(test)

    def addFailure(self, test, error):
        super().addFailure(test, error)
        self._add(test, 'failure', self.failures[-1][1])

    def addError(self, test, error):
        super().addError(test, error)
        self._add(test, 'error', self.errors[-1][1])

    def addSkip(self, test, reason):
        super().addSkip(test, reason)
        self._add(test, 'skipped', reason)


def run(test_class):
    """Runs the cases of a unittest.TestCase, writes the file that rostest asks for, and ends the program."""
    runner = unittest.TextTestRunner(sys.stdout, verbosity=2, resultclass=_Result)
    result = runner.run(unittest.defaultTestLoader.loadTestsFromTestCase(test_class))
    suite = result.suite
    cases = suite.findall('testcase')
    suite.set('name', test_class.__name__)
    suite.set('tests', str(len(cases)))
    for attribute, kind in ('failures', 'failure'), ('errors', 'error'), ('skipped', 'skipped'):
        suite.set(attribute, str(len(suite.findall('.//' + kind))))
    for argument in sys.argv:
        if argument.startswith('--gtest_output=xml:'):
            ElementTree.ElementTree(suite).write(argument.split(':', 1)[1], encoding='utf-8', xml_declaration=True)
    sys.exit(0 if result.wasSuccessful() else 1)
