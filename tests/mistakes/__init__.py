"""Sound tests of several machines, spoilt on purpose: is each mistake refused, or named with the right guess?"""
