# SPDX-License-Identifier: GPL-2.0-or-later
# Comments of the headers for Doxygen: "@depth" names a parameter, and the comment that a file
# opens with, behind its licence, is the file's.
s/@\(param\|return\|see\)\>/\x01\1/g
s/@\([a-z]\)/\\p \1/g
s/\x01/@/g
2s/^\/\*$/\/** @file/
