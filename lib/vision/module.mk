# SPDX-License-Identifier: GPL-2.0-or-later
# Detection of the scalpel in frames, in C++; and of a board, which needs more of OpenCV that a
# measurement of depth need not map. Debian's opencv4.pc is in the package of all of OpenCV, half a
# gigabyte: two small ones will do.
modules := vision_opencv board_opencv
flags_vision_opencv := $(or $(shell $(PKG_CONFIG) --cflags opencv4 2>/dev/null),-I/usr/include/opencv4)
headers_vision_opencv := opencv2/imgproc.hpp cstdio jpeglib.h
libs_vision_opencv := -lopencv_imgproc -lopencv_core -ljpeg -lstdc++
only_vision_opencv := vision vision_opencv edge handle
flags_board_opencv := $(flags_vision_opencv)
headers_board_opencv := opencv2/calib3d.hpp $(headers_vision_opencv)
libs_board_opencv := -lopencv_calib3d $(libs_vision_opencv)
only_board_opencv := board/board_opencv
