// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What hangs together in a mask; see pieces.h. Each run begins a piece of its own; those
 * that touch a run of the row above are joined with it:
 *
 *      row above   ·███····██·      two runs touch when neither ends before the
 *      row         ··██████···      other begins
 */
#include <algorithm>
#include <cstring>
#include "pieces.h"

namespace vision
{

static int root_of(std::vector<int> &parent, int i)
{
	while (parent[i] != i) {
		parent[i] = parent[parent[i]];
		i = parent[i];
	}
	return i;
}

static void read_runs(const cv::Mat &mask, int y, std::vector<run> &runs)
{
	const uint8_t *row = mask.ptr(y);
	int x = 0;

	while (x < mask.cols) {
		uint64_t eight;

		/* most of it is not the handle */
		if (x + 8 <= mask.cols) {
			memcpy(&eight, row + x, sizeof(eight));
			if (!eight) {
				x += 8;
				continue;
			}
		}
		if (!row[x]) {
			x++;
			continue;
		}
		const void *end = memchr(row + x, 0, mask.cols - x);
		int to = end ? (int)((const uint8_t *)end - row) : mask.cols;

		runs.push_back({y, x, to, (int)runs.size()});
		x = to;
	}
}

void pieces::find(const cv::Mat &mask)
{
	size_t above = 0, row = 0;

	runs.clear();
	list.clear();
	parent.clear();
	for (int y = 0; y < mask.rows; y++) {
		size_t a = above;

		row = runs.size();
		read_runs(mask, y, runs);
		for (size_t i = row; i < runs.size(); i++) {
			parent.push_back((int)i);
			while (a < row && runs[a].to < runs[i].from)
				a++;
			for (size_t b = a; b < row && runs[b].from <= runs[i].to; b++) {
				int one = root_of(parent, (int)b);
				int other = root_of(parent, (int)i);

				/* the root is a piece's first run */
				parent[std::max(one, other)] = std::min(one, other);
			}
		}
		above = row;
	}
	for (size_t i = 0; i < runs.size(); i++) {
		run &r = runs[i];
		cv::Rect box(r.from, r.y, r.to - r.from, 1);
		int root = root_of(parent, (int)i);

		if (root == (int)i) {
			r.piece = (int)list.size();
			list.push_back({box, box.width});
			continue;
		}
		r.piece = runs[root].piece;
		piece &p = list[r.piece];
		p.box |= box;
		p.area += box.width;
	}
}

} // namespace vision
