/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The larynx as it shows through the skin of a neck.
 */
#ifndef INCISE_LARYNX_H
#define INCISE_LARYNX_H

/* The least side of a texture that it fits on. */
#define LARYNX_SIDE_MM 60.0

/*
 * Height above the skin around it, 0 to 5 mm, smooth. @caudal_mm from the cricothyroid
 * membrane towards the chest, @side_mm from the midline.
 */
double larynx_height_mm(double caudal_mm, double side_mm);

#endif
