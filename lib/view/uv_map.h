/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The map between a scene's surface and its texture, and the triangles that are drawn.
 *
 *         px[0] ──►  size                     right (tangent)
 *       ┌──────────────┐               ────►
 * px[1] │ texel (0, 0) │             ▲ normal, to the viewer
 *   │   │ has its      │          down = right × normal
 *   ▼   │ centre at .5 │
 *       └──────────────┘  seen from outside the image is not mirrored
 *
 * The middle of the texture is the surface's top, unless the surface ends sooner than the
 * texture would. By the kind of surface:
 *   capsule    its wall unrolled: x along the axis (from a to b), y around it, at most
 *              160 mm along and ±80° around; on the round ends arcs go on as meridians
 *   mesh with texture coordinates   its own triangles; u = px[0] / size, v = 1 - px[1] / size
 *   all others, and a capsule that stands   seen straight from above the top, at most
 *              120 × 120 mm
 * Lengths in mm, in the tracker's frame; texels as doubles. A map does not change once
 * made and may be read by several threads. It keeps the surface, which has to live longer.
 */
#ifndef INCISE_VIEW_UV_MAP_H
#define INCISE_VIEW_UV_MAP_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/scene.h>
#include <incise/surface.h>

/* Maximum height of the relief above the surface as it is felt. */
#define UV_MAP_RELIEF_MAX_MM 5.0

struct uv_map_vertex {
	float position_mm[3]; /* as drawn, with the relief */
	float normal[3];      /* unit, of the drawn surface */
	float tangent[4]; /* unit, towards +px[0]; [3] (normal × tangent) is +px[1] */
	float px[2];	  /* texels */
};

/* Triangles of a mesh in texture space, to find the triangle of a texel. */
struct uv_atlas;

struct uv_map {
	int size; /* of the texture, texels */
	int n_vertices, n_indices;
	struct uv_map_vertex *vertices;
	uint32_t *indices; /* triangles, counter-clockwise seen from outside */

	/* The rest is private. */
	const struct incise_surface *surface;
	enum { UV_MAP_FROM_ABOVE, UV_MAP_UNROLLED, UV_MAP_ATLAS } kind;
	bool larynx;
	double wide_mm, high_mm; /* of the whole texture */
	double top_mm[2];	 /* the surface's top, from the texture's middle */
	/* From above: the texture's middle; unrolled: where the axis starts; the frame. */
	double origin[3], right[3], down[3], up[3];
	double above_mm, below_mm; /* the surface lies between, from the origin */
	double radius_mm, axis_mm, middle_mm; /* unrolled; the texture's middle along */
	struct uv_atlas *atlas;
};

/*
 * About 20 000 triangles; of a mesh with texture coordinates its own. NULL with errno:
 * ENOMEM, EINVAL (texture_px is no power of 2 from 16 to 16384).
 */
struct uv_map *uv_map_new(const struct incise_surface *surface,
			  const struct incise_scene_picture *picture,
			  struct incise_error *err);
void uv_map_free(struct uv_map *map);

/* The texel of a point on or near the surface; false: outside of the texture, or not finite. */
bool uv_map_px(const struct uv_map *map, const double point_mm[3], double px[2]);

/*
 * The point of the surface, as it is felt, and its outward unit normal; false, without a result:
 * there is no surface at that place of the texture.
 */
bool uv_map_point(const struct uv_map *map, const double px[2], double point_mm[3],
		  double normal[3]);

/*
 * The change of the surface's point per texel. Outside the surface: as at the nearest texel at the
 * texture's border, or as for flat ground.
 */
void uv_map_metric(const struct uv_map *map, const double px[2], double right_mm[3],
		   double down_mm[3]);

/* Towards the lamp, in the tracker's frame: high on the left, to show shadow and shine. */
#define UV_MAP_LAMP               \
	{                         \
		-0.62, 0.12, 0.78 \
	}

/*
 * The height of the surface as drawn above that as felt, along the normal: 0 to
 * UV_MAP_RELIEF_MAX_MM, 0 without a larynx. The head is towards -px[0], the membrane that a
 * cricothyroidotomy cuts at the surface's top. A mesh with texture coordinates has no relief.
 */
double uv_map_relief_mm(const struct uv_map *map, const double px[2]);

/* The same above the nearest point of the surface; its normal where there is a larynx. */
double uv_map_relief_at_mm(const struct uv_map *map, const double point_mm[3],
			   double normal[3]);

/*
 * The point of the surface, as it is felt, and its normal, where a ray of length far_mm along a
 * unit vector first meets the surface as it is drawn. False: nowhere, or the way is not finite.
 */
bool uv_map_meet(const struct uv_map *map, const double from_mm[3], const double way[3],
		 double far_mm, double point_mm[3], double normal[3]);

/*
 * The larynx's height above the skin around it, 0 to 5 mm, smooth. @caudal_mm from the
 * cricothyroid membrane towards the chest, @side_mm from the midline.
 */
double larynx_height_mm(double caudal_mm, double side_mm);

/*
 * For uv_map.c only, an atlas: a mesh's own texture coordinates (uv_map_atlas.c). 0 or -ENOMEM;
 * the kind becomes an atlas only if some texel is on the mesh. The others return false, and write
 * nothing, where no triangle is.
 */
int uv_atlas_init(struct uv_map *map);
void uv_atlas_free(struct uv_atlas *atlas);
bool uv_atlas_px(const struct uv_map *map, const double point_mm[3], double px[2]);
bool uv_atlas_point(const struct uv_map *map, const double px[2], double point_mm[3],
		    double normal[3]);
bool uv_atlas_metric(const struct uv_map *map, const double px[2], double right_mm[3],
		     double down_mm[3]);

/* Its triangles. 0 or -ENOMEM. */
int uv_atlas_mesh(struct uv_map *map);

#endif
