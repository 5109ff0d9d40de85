// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The proxy of a tool: when a contact starts, how it goes on, when it ends.
 *
 *                  the way enters, or the first place lies inside
 *            ┌──────────────────────────────────────────────────────▶┐
 *          free                                                   touching ─┐ glide
 *            └◀──────────────────────────────────────────────────────┘◀─────┘
 *                leave_mm outside, or over the border of an open mesh
 *
 * A free tool costs next to nothing: as long as it stays within the ball that is known to
 * hold no surface, there is nothing to look for.
 *
 * On a mesh the proxy goes at most BUDGET times as far as the tool, as the straight
 * distance between its places before and after a tick. The factor cannot be 1: the way
 * over a wave is longer than the tool's way below it, and the proxy would fall behind for
 * ever. With 2 it keeps up on slopes to 60°, and where it does fall behind (a tool that
 * passes deep below a crest draws the proxy over it at once) it catches up as fast as the
 * tool moves. It waits on the surface, and not at the nearest place, meanwhile. A move
 * ends after so many faces, as after a wrong pose; the next one may go the rest, too.
 */
#include <string.h>
#include "surface.h"

#define BUDGET 2

/* A nearest place that may be farther by a tenth. */
#define NEARLY 0.9

/*
 * A tool this near is on the mesh, on whichever side rounding shows it; a contact ends
 * farther outside than that. A way that ends or starts on the surface then cannot slip
 * through between two ticks.
 */
#define ON_MM 1e-9
#define OFF_MM (2 * ON_MM)

/* Contact ends on one part of a mesh and starts on another at most so often in one tick. */
#define PARTS_MAX 4

static const double up[3] = {0, 0, 1};

void incise_proxy_init(struct incise_proxy *proxy, const struct incise_surface *surface,
		       double leave_mm)
{
	memset(proxy, 0, sizeof(*proxy));
	proxy->surface = surface;
	proxy->leave_mm = leave_mm > 0 ? fmin(leave_mm, PLACE_MAX_MM) : 0;
	v3_copy(proxy->touch.normal, up);
	proxy->touch.face = -1;
}

static void begin_proxy(struct incise_proxy *proxy, const struct incise_touch *touch)
{
	proxy->touching = proxy->began = true;
	proxy->first = proxy->touch = *touch;
}

/* Plane, sphere, capsule: the proxy is the nearest point. */
static void move_on_shape(struct incise_proxy *proxy, const double tool[3])
{
	const struct incise_surface *surface = proxy->surface;
	struct incise_touch touch, first;
	double last[3], way[3];
	bool near;

	if (surface->kind == INCISE_SURFACE_PLANE)
		plane_nearest(&surface->plane, tool, &touch);
	else
		capsule_nearest(&surface->capsule, tool,
				proxy->touching ? proxy->touch.normal : up, &touch);
	v3_copy(last, proxy->tool_mm);
	if (!proxy->touching) {
		/* A way shorter than the distance to the surface does not reach it. */
		v3_sub(way, tool, last);
		near = !(v3_length(way) < -touch.depth_mm);
		if (near && proxy->placed &&
		    incise_surface_enters(surface, last, tool, &first))
			begin_proxy(proxy, &first);
		else if (touch.depth_mm >= 0)
			begin_proxy(proxy, &touch);
	}
	proxy->touch = touch;
	proxy->settled = true;
	if (proxy->touching && touch.depth_mm < -proxy->leave_mm)
		proxy->touching = proxy->began = false;
}

static struct mesh_spot spot_of(const struct incise_proxy *proxy)
{
	/* Where it is on its face does not matter: gliding starts with the face. */
	struct mesh_spot spot = {.face = proxy->at_face, .part = TRIANGLE_FACE};

	v3_copy(spot.point, proxy->touch.point_mm);
	return spot;
}

static void begin_at(struct incise_proxy *proxy, const struct mesh_spot *spot,
		     const double tool[3])
{
	struct incise_touch touch;

	mesh_touch(proxy->surface->mesh, spot, tool, &touch);
	proxy->at_face = spot->face;
	begin_proxy(proxy, &touch);
}

static void end_proxy(struct incise_proxy *proxy)
{
	proxy->touching = proxy->began = false;
	proxy->clear_mm = 0;
}

/*
 * The place that is nearest to a tool, or farther by a tenth: in the middle of a ball, where all the mesh is nearly as
 * near, nothing else ends a search. Another side of thin tissue may be nearly as near, too, and it would take the
 * air for inside: where the straight way does not say the same as the place does, the nearest one decides.
 *
 * @return no surface is nearer than this
 */
static double find_near(const struct mesh *mesh, const double tool[3], uint32_t hint,
			struct mesh_spot *spot, struct incise_touch *touch)
{
	double clear_mm = mesh_nearest(mesh, tool, hint, mesh->open ? 1 : NEARLY, spot);
	struct mesh_spot first;
	bool tired;

	/* Only around where it is the nearest do normals say on which side a tool is. */
	if (!mesh->open)
		mesh_glide(mesh, tool, INFINITY, spot, &tired);
	mesh_touch(mesh, spot, tool, touch);
	if (!mesh->open && mesh_enters(mesh, tool, spot->point, 0, 0, &first) ==
				   (touch->depth_mm >= 0)) {
		clear_mm = mesh_nearest(mesh, tool, spot->face, 1, spot);
		mesh_touch(mesh, spot, tool, touch);
	}
	return clear_mm;
}

/*
 * A proxy that is still on its way has the tool in front of its face: because the tool
 * has gone out, or because there is a dent between the two. Where the straight way to the
 * tool enters it is a dent, the tool is inside, and the proxy goes on gliding. A way that
 * starts on the edge of the dent may enter right there, and rounding then hides it: if no face is found, the nearest
 * one to the tool decides.
 */
static bool is_dent(const struct incise_proxy *proxy, const struct mesh_spot *spot,
		    const double tool[3])
{
	const struct mesh *mesh = proxy->surface->mesh;
	struct mesh_spot other, next;
	struct incise_touch touch;

	if (mesh_enters(mesh, spot->point, tool, 0, 0, &other))
		return true;
	find_near(mesh, tool, spot->face, &other, &touch);
	return touch.depth_mm >= 0 && !mesh_beyond_border(mesh, &other, tool, &next);
}

/*
 * Glide at most @reach towards the tool, and end the contact when it has left; where its
 * way from there enters another part of the mesh, the contact restarts on that one.
 */
static void follow_proxy(struct incise_proxy *proxy, const double tool[3], double reach)
{
	const struct mesh *mesh = proxy->surface->mesh;
	double leave = fmax(proxy->leave_mm, OFF_MM);
	struct mesh_spot spot = spot_of(proxy), entry;

	proxy->left_mm = 0;
	for (int part = 0; part < PARTS_MAX; part++) {
		double way[3], above, last[3];
		bool beyond, tired;

		v3_copy(last, spot.point);
		proxy->settled = mesh_glide(mesh, tool, reach, &spot, &tired);
		proxy->at_face = spot.face;
		mesh_touch(mesh, &spot, tool, &proxy->touch);
		v3_sub(way, tool, spot.point);
		above = v3_dot(way, proxy->touch.normal);
		if (!proxy->settled) {
			if (tired)
				proxy->left_mm = fmax(
					reach - sqrt(v3_distance2(spot.point, last)), 0);
			if (!(above > 0))
				return;
			if (is_dent(proxy, &spot, tool))
				proxy->touch.depth_mm = v3_length(way);
			else if (above > leave)
				end_proxy(proxy);
			else
				proxy->touch.depth_mm = -above;
			return;
		}
		beyond = mesh_beyond_border(mesh, &spot, tool, &entry);
		if (entry.face != spot.face) {
			/* Over a seam, as over any edge. */
			reach = fmax(reach - sqrt(v3_distance2(spot.point, last)), 0);
			spot = entry;
			continue;
		}
		if (!(proxy->touch.depth_mm < -leave) && !beyond)
			return;
		/* At the nearest place around, it is rounding that enters where it starts. */
		if (!mesh_enters(mesh, spot.point, tool, ON_MM, 0, &entry)) {
			end_proxy(proxy);
			return;
		}
		spot = entry;
		begin_at(proxy, &spot, spot.point);
		v3_sub(way, tool, spot.point);
		reach = BUDGET * v3_length(way);
	}
}

/* The tool has no contact: is there one now? */
static void look_proxy(struct incise_proxy *proxy, const double tool[3])
{
	const struct mesh *mesh = proxy->surface->mesh;
	struct mesh_spot spot, near;
	double way[3], length, share;

	v3_sub(way, tool, proxy->clear_at_mm);
	if (v3_dot(way, way) < proxy->clear_mm * proxy->clear_mm)
		return;
	/*
	 * Half a ball is good enough, and found in a bounded time even in the middle of a
	 * sphere, where all the mesh is equally near. A ball that the next tick's way would leave is not worth its
	 * search: then only the boxes around the tool show whether it is on the surface.
	 */
	v3_sub(way, tool, proxy->tool_mm);
	length = v3_length(way);
	mesh_on_face(mesh, proxy->at_face, tool, near.point);
	share = v3_distance2(near.point, tool) > 9 * length * length ? 0.5 : 0;
	proxy->clear_mm = mesh_nearest(mesh, tool, proxy->at_face, share, &near);
	v3_copy(proxy->clear_at_mm, tool);
	proxy->at_face = near.face;
	if (proxy->clear_mm > length)
		return;
	if (mesh_enters(mesh, proxy->tool_mm, tool, 0, 0, &spot) ||
	    (mesh->open &&
	     mesh_enters(mesh, proxy->tool_mm, tool, 0, MESH_SEAM_MM, &spot))) {
		begin_at(proxy, &spot, spot.point);
		v3_sub(way, tool, spot.point);
		follow_proxy(proxy, tool, BUDGET * v3_length(way));
	} else if (v3_distance2(near.point, tool) <= ON_MM * ON_MM &&
		   !mesh_beyond_border(mesh, &near, tool, &spot)) {
		begin_at(proxy, &near, tool);
		follow_proxy(proxy, tool, 0);
	}
}

/* The first place of all: inside is in contact, at the nearest point around. */
static void place_proxy(struct incise_proxy *proxy, const double tool[3])
{
	const struct mesh *mesh = proxy->surface->mesh;
	struct incise_touch touch;
	struct mesh_spot spot, next;

	proxy->clear_mm = find_near(mesh, tool, 0, &spot, &touch);
	v3_copy(proxy->clear_at_mm, tool);
	proxy->at_face = spot.face;
	if (touch.depth_mm < -ON_MM || mesh_beyond_border(mesh, &spot, tool, &next))
		return;
	proxy->settled = true;
	begin_at(proxy, &spot, tool);
}

void incise_proxy_move(struct incise_proxy *proxy, const double tool_mm[3])
{
	double tool[3], way[3];

	proxy->began = false;
	if (!v3_finite(tool_mm))
		return;
	surface_place(tool, tool_mm);
	if (!proxy->surface->mesh) {
		move_on_shape(proxy, tool);
	} else if (!proxy->placed) {
		place_proxy(proxy, tool);
	} else {
		v3_sub(way, tool, proxy->tool_mm);
		if (!proxy->touching)
			look_proxy(proxy, tool);
		else if (v3_dot(way, way) > 0)
			follow_proxy(proxy, tool,
				     proxy->left_mm + BUDGET * v3_length(way));
	}
	v3_copy(proxy->tool_mm, tool);
	proxy->placed = true;
}
