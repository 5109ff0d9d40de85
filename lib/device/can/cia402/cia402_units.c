// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Profile and units of a drive (CiA 402-2, factor group). A turn is a turn of the screw, that
 * is of the shaft behind the drive's gear, if it has one.
 *
 *   60A8, 60A9, 60AA   31 … 24        23 … 16     15 … 8   7 … 0
 *                      power of ten   numerator   per      –
 */
#include <errno.h>
#include <math.h>
#include "cia402.h"

#define TWO_PI 6.283185307179586
#define MOST_PER_TURN 4294967296.0

/* Numerators that belong to an angle. */
#define UNIT_TURN 0xb4
#define UNIT_INCREMENT 0xb5
#define UNIT_TURN_PER_MINUTE 0xc0 /* of an acceleration: maxon's rpm/s */
#define UNIT_METRE 0x01
/* Denominators. */
#define PER_SECOND 0x03
#define PER_MINUTE 0x47
#define PER_SECOND_2 0x57

static const struct cia402_object device_type = {0x1000, 0, 4, "device type"};
static const struct cia402_object position_unit = {0x60a8, 0, 4, "SI unit position"};
static const struct cia402_object velocity_unit = {0x60a9, 0, 4, "SI unit velocity"};
static const struct cia402_object acceleration_unit = {0x60aa, 0, 4,
						       "SI unit acceleration"};

/* A ratio of two sub-objects. */
static const struct cia402_object feed[] = {{0x6092, 1, 4, "feed"},
					    {0x6092, 2, 4, "shaft revolutions"}};
static const struct cia402_object encoder[] = {{0x608f, 1, 4, "encoder increments"},
					       {0x608f, 2, 4, "motor revolutions"}};
static const struct cia402_object gear[] = {{0x6091, 1, 4, "motor shaft revolutions"},
					    {0x6091, 2, 4, "driving shaft revolutions"}};

int cia402_identify(const struct cia402_client *client)
{
	uint32_t type;
	int rc = canopen_read(client->master, device_type.index, device_type.sub,
			      device_type.size, &type);

	if (rc == -ETIMEDOUT && !client->master->late_ns)
		return cia402_error(client, ENODEV,
				    "no answer from node 0x%02x on %s; check the "
				    "drive's power, its wiring, node id and bit rate, "
				    "and the other nodes that `incise info` finds on "
				    "this bus",
				    client->master->node, client->master->bus->name);
	if (rc)
		return cia402_fail(client, &device_type, "read", rc);
	if ((type & 0xffff) != CIA402_PROFILE)
		return cia402_error(client, EPROTO,
				    "node %u is not a CiA 402 drive: its device "
				    "profile is %u; check the node id",
				    client->master->node, type & 0xffff);
	return 0;
}

static bool is_plausible(double value)
{
	return isfinite(value) && value > 0 && value <= MOST_PER_TURN * 1e9;
}

/* Read a ratio; *value stays unchanged if the drive has no such ratio. */
static int read_ratio(const struct cia402_client *client,
		      const struct cia402_object pair[2], double *value, bool *has)
{
	uint32_t numerator = 0, denominator = 0;
	int rc = cia402_read_optional(client, &pair[0], &numerator, has);

	if (rc || !*has)
		return rc;
	rc = cia402_read(client, &pair[1], &denominator);
	if (rc)
		return rc;
	if (!numerator || !denominator)
		return cia402_error(client, EPROTO,
				    "the drive's %s (%04X) is %u/%u; set it there, or "
				    "give counts_per_turn in rig.conf",
				    pair[0].name, pair[0].index, numerator, denominator);
	*value = (double)numerator / denominator;
	return 0;
}

/* Read encoder increments per turn of the screw; *has false: the drive lacks them. */
static int read_increments(const struct cia402_client *client, double *value, bool *has)
{
	double turns = 1;
	bool geared;
	int rc = read_ratio(client, encoder, value, has);

	if (rc || !*has)
		return rc;
	rc = read_ratio(client, gear, &turns, &geared);
	*value *= turns;
	return rc;
}

/*
 * A drive whose factor group was never set up may have 6092 = 1/1 and count increments. Which of
 * the two it counts by cannot be read.
 */
static int check_feed(const struct cia402_client *client, double units)
{
	double increments = units;
	bool has;
	int rc = read_increments(client, &increments, &has);

	if (rc || fabs(increments - units) <= 1e-9 * units)
		return rc;
	return cia402_error(
		client, EPROTO,
		"a turn of the screw is %g units by the drive's 6092, and %g "
		"increments by its 608F and 6091; give counts_per_turn in "
		"rig.conf: how many it counts (6064) when the screw turns once",
		units, increments);
}

/* Returns units per turn; 0: the unit is no angle. */
static double angle_per_turn(uint8_t unit)
{
	static const struct {
		uint8_t unit;
		double per_turn;
	} angles[] = {
		{UNIT_TURN, 1},
		{0x41 /* degree */, 360},
		{0x10 /* radian */, TWO_PI},
		{0x40 /* gon */, 400},
		{0x42 /* minute of arc */, 360 * 60},
		{0x43 /* second of arc */, 360 * 3600},
	};

	for (size_t i = 0; i < sizeof(angles) / sizeof(*angles); i++)
		if (angles[i].unit == unit)
			return angles[i].per_turn;
	return 0;
}

static double power_of_ten(uint32_t unit)
{
	return pow(10, (int8_t)(unit >> 24));
}

static int refuse_unit(const struct cia402_client *client,
		       const struct cia402_object *object, uint32_t unit, const char *key)
{
	return cia402_error(client, EPROTO,
			    "the drive's %s (%04X), %08Xh, is unknown; give %s in "
			    "rig.conf",
			    object->name, object->index, unit, key);
}

static int read_positions(const struct cia402_client *client, double *per_turn)
{
	uint32_t unit = 0;
	bool has = false;
	uint8_t code;
	int rc = cia402_read_optional(client, &position_unit, &unit, &has);

	if (rc)
		return rc;
	code = (uint8_t)(unit >> 16);
	if (has && angle_per_turn(code) > 0) {
		*per_turn = angle_per_turn(code) / power_of_ten(unit);
	} else if (has && code == UNIT_INCREMENT && !(unit >> 24)) {
		rc = read_increments(client, per_turn, &has);
		if (!rc && !has)
			rc = read_ratio(client, feed, per_turn, &has);
	} else if (!has || code == 0 || code == UNIT_METRE) {
		rc = read_ratio(client, feed, per_turn, &has);
		if (!rc && !has)
			rc = read_increments(client, per_turn, &has);
		else if (!rc && code != UNIT_METRE)
			rc = check_feed(client, *per_turn);
	} else {
		return refuse_unit(client, &position_unit, unit, "counts_per_turn");
	}
	if (rc)
		return rc;
	if (!is_plausible(*per_turn) || *per_turn < 1 || *per_turn > MOST_PER_TURN)
		return cia402_error(client, EPROTO,
				    "the drive does not report its counts per turn "
				    "(6092, 608F, 60A8: %g); give counts_per_turn in "
				    "rig.conf",
				    *per_turn);
	return 0;
}

/* Read the unit of velocity or acceleration; without one it is @counts. */
static int read_rates(const struct cia402_client *client,
		      const struct cia402_object *object, double counts, bool squared,
		      double *per_turn, bool *reported, const char *key)
{
	uint32_t unit = 0;
	uint8_t code, per;
	double turn;
	bool has = false;
	int rc = cia402_read_optional(client, object, &unit, &has);

	*reported = has;
	if (rc)
		return rc;
	if (!has) {
		*per_turn = counts;
		return 0;
	}
	code = (uint8_t)(unit >> 16);
	per = (uint8_t)(unit >> 8);
	turn = angle_per_turn(code);
	if (code == UNIT_INCREMENT) {
		rc = read_increments(client, &turn, &has);
		if (rc)
			return rc;
		if (!has)
			turn = counts;
	}
	if (squared && code == UNIT_TURN_PER_MINUTE && per == PER_SECOND)
		turn = 60;
	else if (!squared && per == PER_MINUTE)
		turn *= 60;
	else if (per != (squared ? PER_SECOND_2 : PER_SECOND))
		turn = 0;
	*per_turn = turn / power_of_ten(unit);
	if (turn <= 0 || !is_plausible(*per_turn))
		return refuse_unit(client, object, unit, key);
	return 0;
}

int cia402_read_units(const struct cia402_client *client, struct cia402_units *units)
{
	bool reported;
	struct cia402_units found = *units;
	int rc = 0;

	if (found.counts_per_turn == 0)
		rc = read_positions(client, &found.counts_per_turn);
	if (!rc && found.velocity_per_turn_s == 0)
		rc = read_rates(client, &velocity_unit, found.counts_per_turn, false,
				&found.velocity_per_turn_s, &reported,
				"velocity_per_turn_s");
	if (!rc && found.acceleration_per_turn_s2 == 0) {
		rc = read_rates(client, &acceleration_unit, found.counts_per_turn, true,
				&found.acceleration_per_turn_s2, &reported,
				"acceleration_per_turn_s2");
		/*
		 * A drive with another unit of velocity does not count accelerations in counts:
		 * if it did here, its quick stop would have no ramp.
		 */
		if (!rc && !reported &&
		    found.velocity_per_turn_s != found.counts_per_turn)
			rc = cia402_error(client, EPROTO,
					  "the unit of velocity is not a count per "
					  "second, and the drive does not report the "
					  "unit of acceleration (60AA); give "
					  "acceleration_per_turn_s2 in rig.conf, see "
					  "its manual");
	}
	if (rc)
		return rc;
	*units = found;
	return 0;
}
