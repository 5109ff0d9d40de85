/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The geometry of looking: matrices for OpenGL, and the ray of a pixel. See the drawing in
 * incise/view.h. Matrices are column by column; lengths in mm.
 *
 *      eye frame:  y up          clip space: -1 … 1, near at -1
 *                  │
 *                  ○──▶ x right; one looks along -z
 */
#ifndef INCISE_VIEW_EYE_H
#define INCISE_VIEW_EYE_H

#include <stdbool.h>
#include <incise/view.h>

struct incise_eye {
	double eye_mm[3];
	double right[3], up[3], back[3]; /* unit, at right angles */
	float clip[16];			 /* of a place in mm */
	double half_height;		 /* of the picture at distance 1 */
};

/* Hold all within its range; false, and nothing changed, when a number is not finite. */
bool incise_eye_hold(struct incise_view_camera *camera);

/*
 * @param reach_mm nothing that is drawn is farther from the target
 */
void incise_eye_look(const struct incise_view_camera *camera, int width, int height,
		     double reach_mm, struct incise_eye *eye);

/* Where a pixel looks to: a unit vector. */
void incise_eye_way(const struct incise_eye *eye, int width, int height, double x_px,
		    double y_px, double way[3]);

/* Where a place is in the picture; false: behind the eye. */
bool incise_eye_px(const struct incise_eye *eye, int width, int height,
		   const double point_mm[3], double px[2]);

#endif
