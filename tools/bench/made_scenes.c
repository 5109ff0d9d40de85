// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Scenes for incise bench scenes; see made_scenes.h.
 */
#include "made_scenes.h"
#include "sheet.h"

#define ALL                                                    \
	"tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; " \
	"damping_N_s_mm = 0.0005;\n  insertion_N_mm = 0.28; "  \
	"spread_N_mm = 0.22; };\neffects = { average_ticks = 8; guard = true; };\n"
#define SPHERE                                                           \
	"surface = { kind = \"sphere\"; centre_mm = [0.0, 0.0, -50.0]; " \
	"radius_mm = 50.0; };\n"
#define DOUBLE "arithmetic = \"double\";\n"
#define FIXED "arithmetic = \"fixed\";\n"
#define REACTION "tissue = { reaction_N_mm = 0.14; };\n"
#define MESH "surface = { kind = \"mesh\"; file = \"%s\"; };\n"

/* Along each side of the sheet, two triangles each: 20 000. */
#define CELLS 100

static const struct {
	const char *name, *text;
	bool mesh, kept;
} scenes[] = {
	{"plane_reaction", DOUBLE REACTION, false, false},
	{"plane_kept", DOUBLE REACTION, false, true},
	{"plane_constraint",
	 DOUBLE "tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; };\n", false, false},
	{"sphere_all", DOUBLE SPHERE ALL, false, false},
	{"sphere_all_fixed", FIXED SPHERE ALL, false, false},
	{"mesh_reaction", DOUBLE MESH REACTION, true, false},
	{"mesh_all", DOUBLE MESH ALL, true, false},
};

_Static_assert(sizeof(scenes) / sizeof(*scenes) == MADE_SCENES, "room for each");

void made_scene_begin(struct made_scene *made, int number)
{
	*made = (struct made_scene){
		.name = scenes[number].name,
		.kept = scenes[number].kept,
		.scene = memory_file_begin(scenes[number].name),
	};
	if (scenes[number].mesh) {
		made->sheet = sheet_of_waves(CELLS);
		fprintf(made->scene.file, scenes[number].text, made->sheet.path);
	} else {
		fputs(scenes[number].text, made->scene.file);
	}
	memory_file_written(&made->scene);
}

void made_scene_end(struct made_scene *made)
{
	fclose(made->scene.file);
	if (made->sheet.file)
		fclose(made->sheet.file);
}
