// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module that finds a chessboard, on OpenCV; see incise/board.h. No exception gets past
 * this file.
 */
#include <algorithm>
#include <cerrno>
#include <new>
#include <vector>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <incise/backend.h>
#include <incise/board.h>
#include "../image.h"

namespace
{

constexpr double most_stray = 1; /* px */

/*
 * Found corners are accurate to 0.2 px, the crossing of their edges to 0.04 px. No other corner
 * may be within reach. A corner that strays is searched with a smaller reach, and in the end
 * stays as it was found.
 */
void refine(const cv::Mat &grey, int columns, std::vector<cv::Point2f> &corners)
{
	const cv::TermCriteria enough(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 60,
				      1e-3);
	const std::vector<cv::Point2f> found = corners;
	double apart = 24;

	for (size_t i = 1; i < found.size(); i++) {
		if (i % columns)
			apart = std::min(apart, cv::norm(found[i] - found[i - 1]));
		if (i >= (size_t)columns)
			apart = std::min(apart, cv::norm(found[i] - found[i - columns]));
	}
	for (size_t i = 0; i < found.size(); i++)
		for (int reach = std::max(2, (int)(apart / 3)); reach >= 2; reach--) {
			std::vector<cv::Point2f> one(1, found[i]);

			cv::cornerSubPix(grey, one, cv::Size(reach, reach),
					 cv::Size(-1, -1), enough);
			if (cv::norm(one[0] - found[i]) < most_stray) {
				corners[i] = one[0];
				break;
			}
		}
}

int find(const struct incise_camera_frame &frame, int columns, int rows, double *corners,
	 struct incise_error *err)
{
	vision::image image;
	int ret = image.take(frame);

	if (ret)
		return incise_error_set(err, -ret,
					"board: the frame's sizes are inconsistent");
	if (columns < 3 || columns > 100 || rows < 3 || rows > 100)
		return incise_error_set(err, EINVAL,
					"board: %d x %d inner corners: give 3 to 100",
					columns, rows);
	ret = image.bring(cv::Rect(cv::Point(), image.size));
	if (ret)
		return incise_error_set(err, -ret, "board: the frame cannot be decoded");

	cv::Mat grey(image.size, CV_8U);
	std::vector<cv::Point2f> found;

	for (int y = 0; y < grey.rows; y++)
		for (int x = 0; x < grey.cols; x++) {
			float v[3];

			image.pixel(x, y, v);
			if (image.channels() == 3)
				v[0] = 0.299f * v[0] + 0.587f * v[1] + 0.114f * v[2];
			grey.at<uint8_t>(y, x) = cv::saturate_cast<uint8_t>(v[0]);
		}
	/* More effort finds more boards, less accurately: with normalized light, one corner of
	 * 4500 was 8 px off and the rest 0.3 px. */
	const cv::Size size(columns, rows);
	if (!cv::findChessboardCornersSB(grey, size, found, 0) &&
	    !cv::findChessboardCornersSB(grey, size, found, cv::CALIB_CB_EXHAUSTIVE) &&
	    !cv::findChessboardCornersSB(grey, size, found,
					 cv::CALIB_CB_EXHAUSTIVE |
						 cv::CALIB_CB_NORMALIZE_IMAGE))
		found.clear();
	if ((int)found.size() != columns * rows)
		return incise_error_set(
			err, ENODATA,
			"board: no chessboard of %d x %d inner corners found; show all "
			"of it, sharp and evenly lit, with white around it",
			columns, rows);
	refine(grey, columns, found);
	/* OpenCV counts from the middle of the first pixel. */
	for (const cv::Point2f &corner : found) {
		*corners++ = corner.x + 0.5;
		*corners++ = corner.y + 0.5;
	}
	return 0;
}

int opencv_find(struct incise_board *, const struct incise_camera_frame *frame,
		int columns, int rows, double *corners, struct incise_error *err)
{
	try {
		return find(*frame, columns, rows, corners, err);
	} catch (const std::bad_alloc &) {
		return incise_error_set(err, ENOMEM, "board: out of memory");
	} catch (...) {
		return incise_error_set(err, EIO, "board: OpenCV failed");
	}
}

void opencv_close(struct incise_board *)
{
}

/* Images have no state in common. */
void *opencv_open(const struct incise_backend_request *, struct incise_error *)
{
	static const struct incise_board_ops ops = {opencv_find, opencv_close};
	static struct incise_board board = {&ops};

	cv::setNumThreads(1);
	return &board;
}

} // namespace

extern "C" {
const struct incise_backend incise_backend = {INCISE_BACKEND_ABI, "board", "opencv",
					      opencv_open, nullptr};
}
