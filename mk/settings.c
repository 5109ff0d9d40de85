// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Prints the tables of settings for mk/manual-tables, which puts them into the manual pages:
 *
 *   TABLE <tab> KEY <tab> UNIT <tab> RANGE <tab> DEFAULT <tab> MEANING
 *   forces <tab> STAGE <tab> PHASES <tab> FORMULA <tab> <tab> WHAT IT DOES
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../lib/rig/actuator.h"
#include "../lib/rig/rig_plan.h"
#include "../lib/scene/forces.h"
#include "../lib/scene/scene.h"
#include "../lib/sim/sim.h"

static int elements(const struct incise_setting *row)
{
	size_t size = row->store == SETTING_STORES_DOUBLE ? sizeof(double)
		      : row->store == SETTING_STORES_U8	  ? 1
		      : row->store == SETTING_STORES_U64  ? sizeof(uint64_t)
							  : sizeof(int);

	return (int)(row->size / size);
}

static void print_kind(const struct incise_setting *row)
{
	const char *number = row->kind == SETTING_IS_WHOLE ? "int" : "num";
	int n = elements(row);

	if (row->kind == SETTING_IS_GROUP || !strcmp(row->unit, "group"))
		printf("group");
	else if (row->kind == SETTING_IS_TRUTH)
		printf("bool");
	else if (row->kind > SETTING_IS_TRUTH)
		printf("text");
	else if (n == 3)
		printf("vec%s%s", *row->unit ? ", " : "", row->unit);
	else if (n > 1)
		printf("%s%d %s%s%s", row->count ? "1 to " : "", n, number,
		       *row->unit ? ", " : "", row->unit);
	else if (row->kind == SETTING_IS_WHOLE && *row->unit)
		printf("int, %s", row->unit);
	else
		printf("%s", *row->unit ? row->unit : number);
}

/* 1e6, not 1000000 or 1e+06. */
static void print_number(double value)
{
	char text[32], *exponent;
	size_t length;
	int zeros = 0;

	snprintf(text, sizeof(text), "%.10g", value);
	for (length = strlen(text); length > 1 && text[length - 1] == '0'; length--)
		zeros++;
	exponent = strchr(text, 'e');
	if (zeros >= 6 && !exponent)
		printf("%.*se%d", (int)length, text, zeros);
	else if (exponent)
		printf("%.*se%d", (int)(exponent - text), text, atoi(exponent + 1));
	else
		printf("%s", text);
}

/* That of coordinates, up to 1e6, stands once in the page. */
static void print_range(const struct incise_setting *row)
{
	if (row->kind == SETTING_IS_DIRECTION) {
		printf("direction");
	} else if (row->kind < SETTING_IS_DIRECTION &&
		   !(elements(row) == 3 && row->min == -1e6 && row->max == 1e6)) {
		print_number(row->min);
		printf("..");
		print_number(row->max);
	}
}

static void print_default(const struct incise_setting *row)
{
	size_t length = strlen(row->initial);

	if (row->kind != SETTING_IS_GROUP && strcmp(row->unit, "group") != 0)
		printf("%.*s", *row->initial == '(' ? (int)length - 2 : (int)length,
		       row->initial + (*row->initial == '('));
}

static int print_table(const char *name, const struct incise_setting *rows)
{
	for (; rows->key; rows++) {
		if (!*rows->help) {
			fprintf(stderr, "%s: %s has no help\n", name, rows->key);
			return 1;
		}
		printf("%s\t%s\t", name, rows->key);
		print_kind(rows);
		putchar('\t');
		print_range(rows);
		putchar('\t');
		print_default(rows);
		printf("\t%s\n", rows->help);
	}
	return 0;
}

/* A table, and those of its groups as NAME.GROUP. */
static int print_tables(const char *name, const struct incise_setting *rows)
{
	int failed = print_table(name, rows);

	for (; rows->key && !failed; rows++) {
		char group[80];

		snprintf(group, sizeof(group), "%s.%s", name, rows->key);
		if (rows->kind == SETTING_IS_GROUP)
			failed = print_tables(group, rows->rows);
	}
	return failed;
}

static void print_forces(void)
{
	static const char *const phases[] = {"",	  "", "cutting", "",
					     "insertion", "", "both"};

	for (int i = 0; i < incise_n_tissue_forces; i++)
		printf("forces\t%s\t%s\t%s\t\t%s\n", incise_tissue_forces[i].name,
		       phases[incise_tissue_forces[i].phases],
		       incise_tissue_forces[i].formula, incise_tissue_forces[i].does);
}

int main(void)
{
	static const char *const kinds[] = {"plane", "sphere", "capsule", "heights",
					    "mesh"};
	struct incise_setting tissue[SETTING_ROWS_MAX + 1];
	int failed = print_tables("rig", incise_rig_settings);

	failed |= print_tables("rig.actuator", incise_actuator_settings);
	failed |= print_tables("rig.sim", incise_sim_settings);
	failed |= print_tables("rig.sim_haptic", incise_sim_haptic_settings);
	failed |= print_tables("calibration", incise_calibration_settings);
	failed |= print_tables("scene", incise_scene_settings);
	print_forces();
	incise_scene_tissue_settings(tissue);
	failed |= print_tables("scene.tissue", tissue);
	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++) {
		char name[40];

		snprintf(name, sizeof(name), "scene.surface.%s", kinds[i]);
		failed |= print_table(name, incise_scene_surface_settings(kinds[i]));
	}
	return failed;
}
