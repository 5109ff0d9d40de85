/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How alike two pictures are.
 */
#ifndef INCISE_SIMILARITY_H
#define INCISE_SIMILARITY_H

#include <stdint.h>

struct similarity {
	double rms;  /* of sRGB values, 0 … 255 */
	double ssim; /* 1: the same */
};

/*
 * Pixels of 3 bytes. The structural similarity is that of Wang, Bovik, Sheikh and Simoncelli,
 * "Image quality assessment: from error visibility to structural similarity", 2004, eq. 13,
 * of luma, with its constants; the mean over windows of 8 × 8 pixels side by side, each pixel
 * with the same weight. Pictures are at least 8 pixels wide and high.
 */
struct similarity similarity_of(const uint8_t *a, const uint8_t *b, int width,
				int height);

#endif
