// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The setup of a drive before it may move, in an order in which a drive that was left half-way
 * has no power and no PDOs that could move it.
 *
 *   no power? ─▶ pre-operational ─▶ PDOs off, filled, on ─▶ limits ─▶ mode, cycle
 *   ─▶ reaction to silence, heartbeats ─▶ operational
 */
#include <errno.h>
#include "cia402.h"

#define MS_NS 1000000LL
#define NMT_NS (500 * MS_NS) /* for an NMT state to be taken */
#define SYNC_ID 0x80
#define QUICK_STOP 3	/* 6007 */
#define RAMP_THEN_OFF 2 /* 605A: on the quick-stop ramp, then without power */

static const struct cia402_object sync_id = {0x1005, 0, 4, "SYNC id"};
static const struct cia402_object sync_period = {0x1006, 0, 4, "communication cycle"};
static const struct cia402_object sync_window = {0x1007, 0, 4, "SYNC window"};
static const struct cia402_object emcy_id = {0x1014, 0, 4, "EMCY id"};
static const struct cia402_object consumer = {0x1016, 1, 4, "heartbeat consumer"};
static const struct cia402_object producer = {0x1017, 0, 2, "heartbeat producer"};
static const struct cia402_object behaviour = {0x1029, 1, 1,
					       "behaviour without a master"};
static const struct cia402_object abort_option = {0x6007, 0, 2,
						  "abort connection option"};
static const struct cia402_object stop_option = {0x605a, 0, 2, "quick-stop option"};
static const struct cia402_object cycle = {0x60c2, 1, 1, "interpolation period"};
static const struct cia402_object cycle_power = {0x60c2, 2, 1,
						 "interpolation period's power of ten"};
/* No object; for messages about NMT commands. */
static const struct cia402_object nmt = {0, 0, 0, "NMT state"};
static const struct cia402_object modes = {0x6502, 0, 4, "supported drive modes"};

/*
 * --- PDOs, in the order of CiA 301: off, empty, filled, counted, on ---
 *
 * A PDO is 1400h/1800h + n (parameters) and 1600h/1A00h + n (mapping).
 *
 *   sub 1  bit 31 off │ bit 30 the drive's own │ 10 … 0 id
 *   sub 2  1: at every SYNC │ 255: at change
 *   sub 3  inhibit time, 100 µs      sub 5  event timer; of an RPDO its deadline; ms
 */

#define RPDO 0x1400
#define TPDO 0x1800
#define MAPPING 0x200 /* from parameters to mapping */
#define PDOS 8	      /* switched off; drives have those beyond off from power-on */

#define OFF 0x80000000u
#define NO_RTR 0x40000000u /* the drive's own bit, which stays */
#define AT_SYNC 1
#define AT_CHANGE 255
#define INHIBIT 100 /* 10 ms; a first change is sent at once; can_units.c relies on it */

#define MAP_CONTROLWORD 0x60400010
#define MAP_STATUSWORD 0x60410010
#define MAP_POSITION 0x60640020
#define MAP_MODE 0x60610008
#define MAP_INPUTS 0x60fd0020
#define MAP_TARGET_POSITION 0x607a0020
#define MAP_TARGET_VELOCITY 0x60ff0020
#define MAP_TARGET_TORQUE 0x60710010

struct pdo {
	uint16_t index;
	uint32_t id;
	uint8_t type;
	uint8_t n; /* objects */
	uint32_t map[3];
};

static struct cia402_object id_of(uint16_t index)
{
	return (struct cia402_object){index, 1, 4, index < TPDO ? "RPDO id" : "TPDO id"};
}

static struct cia402_object mapping(uint16_t index, uint8_t sub)
{
	return (struct cia402_object){(uint16_t)(index + MAPPING), sub, sub ? 4 : 1,
				      sub ? "PDO mapping" : "number of mapped objects"};
}

/* Switch off, keeping id and bit 30: only then may the rest be changed. */
static int switch_off(const struct cia402_client *client, uint16_t index, uint32_t *id,
		      bool *has)
{
	struct cia402_object object = id_of(index);
	int rc = cia402_read_optional(client, &object, id, has);

	if (rc || !*has || *id & OFF)
		return rc;
	return cia402_write_verified(client, &object, *id | OFF);
}

static int fill_cia402_setup(const struct cia402_client *client, const struct pdo *pdo)
{
	const struct cia402_object type = {pdo->index, 2, 1, "PDO transmission type"};
	const struct cia402_object count = mapping(pdo->index, 0);
	int rc = cia402_write_verified(client, &type, pdo->type);

	if (!rc)
		rc = cia402_write(client, &count, 0);
	for (uint8_t i = 0; i < pdo->n && !rc; i++) {
		const struct cia402_object entry = mapping(pdo->index, (uint8_t)(i + 1));

		rc = cia402_write_verified(client, &entry, pdo->map[i]);
	}
	return rc ? rc : cia402_write_verified(client, &count, pdo->n);
}

static int switch_on(const struct cia402_client *client, const struct pdo *pdo,
		     uint32_t id)
{
	struct cia402_object object = id_of(pdo->index);

	return cia402_write_verified(client, &object, (id & NO_RTR) | pdo->id);
}

static int set_pdo(const struct cia402_client *client, const struct pdo *pdo)
{
	struct cia402_object object = id_of(pdo->index);
	uint32_t id;
	bool has;
	int rc = switch_off(client, pdo->index, &id, &has);

	if (rc)
		return rc;
	if (!has)
		return cia402_fail(client, &object, "read", -EREMOTEIO);
	rc = fill_cia402_setup(client, pdo);
	return rc ? rc : switch_on(client, pdo, id);
}

/* Switch off PDOs of other masters and of the drive's defaults, from @first on. */
static int switch_others_off(const struct cia402_client *client, uint16_t base,
			     uint16_t first)
{
	bool has = true;
	uint32_t id;
	int rc = 0;

	for (uint16_t i = first; i < PDOS && has && !rc; i++)
		rc = switch_off(client, (uint16_t)(base + i), &id, &has);
	return rc;
}

/*
 * Map the inputs to TPDO2, which is off. If the drive cannot map them, *mapped is false: nothing
 * watches them, and a caller that needs them reports that.
 */
static int set_inputs(const struct cia402_client *client, uint32_t id, bool *mapped,
		      bool *timed)
{
	static const struct cia402_object inputs = {0x60fd, 0, 4, "digital inputs"};
	static const struct cia402_object inhibit = {TPDO + 1, 3, 2, "PDO inhibit time"};
	static const struct cia402_object timer = {TPDO + 1, 5, 2, "PDO event timer"};
	const struct pdo pdo = {
		TPDO + 1,     CANOPEN_TPDO2 + (uint32_t)client->master->node,
		AT_CHANGE,    1,
		{MAP_INPUTS},
	};
	const struct cia402_object count = mapping(pdo.index, 0);
	const struct cia402_object entry = mapping(pdo.index, 1);
	uint32_t now;
	bool has;
	int rc = cia402_read_optional(client, &inputs, &now, &has);

	*mapped = *timed = false;
	if (rc || !has)
		return rc;
	rc = cia402_write_optional(client, &inhibit, INHIBIT, &has);
	if (!rc)
		rc = cia402_write_optional(client, &timer, CIA402_INPUTS_MS, timed);
	if (!rc)
		rc = cia402_write(client, &count, 0);
	if (rc)
		return rc;
	/* A refusal here, of the entry or of their number, means that it cannot map them. */
	rc = canopen_write(client->master, entry.index, entry.sub, 4, MAP_INPUTS);
	if (!rc)
		rc = canopen_write(client->master, count.index, count.sub, 1, 1);
	if (rc == -EREMOTEIO)
		return 0;
	if (rc)
		return cia402_fail(client, &entry, "written", rc);
	rc = fill_cia402_setup(client, &pdo);
	if (!rc)
		rc = switch_on(client, &pdo, id);
	*mapped = !rc;
	return rc;
}

static uint32_t target(enum cia402_mode mode)
{
	return mode == CIA402_CST   ? MAP_TARGET_TORQUE
	       : mode == CIA402_CSV ? MAP_TARGET_VELOCITY
				    : MAP_TARGET_POSITION;
}

static int set_pdos(const struct cia402_client *client, const struct cia402_setup *setup,
		    struct cia402_supported *supported)
{
	/*
	 * Off, as no set-points go out while the bus is borrowed for SDOs. This side sends
	 * heartbeats only along with set-points, so the drive's watch covers both.
	 */
	static const struct cia402_object deadline = {RPDO, 5, 2, "RPDO deadline"};
	uint32_t node = client->master->node, id = 0;
	const struct pdo set_points = {
		RPDO,
		CANOPEN_RPDO1 + node,
		AT_SYNC,
		2,
		{MAP_CONTROLWORD, target(setup->mode)},
	};
	const struct pdo actual = {
		TPDO,
		CANOPEN_TPDO1 + node,
		AT_SYNC,
		2 + setup->mode_mapped,
		{MAP_STATUSWORD, MAP_POSITION, MAP_MODE},
	};
	bool has, kept;
	int rc = switch_others_off(client, RPDO, 1);

	if (!rc)
		rc = switch_others_off(client, TPDO, 2);
	if (!rc)
		rc = switch_off(client, TPDO + 1, &id, &has);
	if (!rc)
		rc = set_pdo(client, &set_points);
	if (!rc)
		rc = cia402_write_optional(client, &deadline, 0, &kept);
	if (!rc)
		rc = set_pdo(client, &actual);
	if (!rc && has)
		rc = set_inputs(client, id, &supported->inputs, &supported->inputs_timed);
	return rc;
}

/* --- limits that the drive enforces by itself, in its own units --- */

static const struct cia402_object ranges[] = {
	{0x607d, 1, 4, "least position"},
	{0x607d, 2, 4, "largest position"},
};
static const struct cia402_object speed = {0x607f, 0, 4, "largest speed"};
static const struct cia402_object acceleration = {0x60c5, 0, 4, "largest acceleration"};
static const struct cia402_object deceleration = {0x60c6, 0, 4, "largest deceleration"};
static const struct cia402_object window = {0x6065, 0, 4, "following error window"};
static const struct cia402_object window_ms = {0x6066, 0, 2, "following error time"};
static const struct cia402_object torque = {0x6072, 0, 2, "largest torque"};
static const struct cia402_object stop_ramp = {0x6085, 0, 4, "quick-stop deceleration"};

int cia402_set_range(const struct cia402_client *client, int32_t position_min,
		     int32_t position_max)
{
	uint32_t end;
	bool has;
	int rc;

	if (position_min >= position_max)
		return cia402_error(client, EINVAL,
				    "an empty range from %d to %d; check travel_mm and "
				    "counts_per_turn in rig.conf",
				    position_min, position_max);
	rc = cia402_read_optional(client, &ranges[1], &end, &has);
	if (rc || !has)
		return rc;
	/* The least is never above the largest, which some drives refuse. */
	if (position_min >= (int32_t)end)
		rc = cia402_write(client, &ranges[1], (uint32_t)position_max);
	if (!rc)
		rc = cia402_write_verified(client, &ranges[0], (uint32_t)position_min);
	return rc ? rc
		  : cia402_write_verified(client, &ranges[1], (uint32_t)position_max);
}

int cia402_has_range(const struct cia402_client *client, int32_t position_min,
		     int32_t position_max, bool *has)
{
	uint32_t low = 0, high = 0;
	int rc = cia402_read_optional(client, &ranges[0], &low, has);

	if (!rc && *has)
		rc = cia402_read(client, &ranges[1], &high);
	*has = *has && (int32_t)low == position_min && (int32_t)high == position_max;
	return rc;
}

static int set_limits(const struct cia402_client *client,
		      const struct cia402_setup *setup)
{
	bool has;
	const struct {
		const struct cia402_object *object;
		uint32_t value; /* 0: leave it to the drive */
	} limits[] = {
		{&speed, setup->velocity},
		{&acceleration, setup->acceleration},
		/* A drive without this limit brakes by the limit of accelerations. */
		{&deceleration, setup->acceleration},
		{&stop_ramp, setup->acceleration},
		{&window, setup->following},
		{&window_ms, setup->following ? setup->following_ms : 0},
		{&torque, setup->torque_permille},
	};
	int rc = cia402_set_range(client, setup->position_min, setup->position_max);

	for (size_t i = 0; i < sizeof(limits) / sizeof(*limits) && !rc; i++)
		if (limits[i].value)
			rc = cia402_write_optional(client, limits[i].object,
						   limits[i].value, &has);
	return rc;
}

/* --- the whole --- */

static int check_cia402_setup(const struct cia402_client *client,
			      const struct cia402_setup *setup)
{
	const char *problem = NULL;

	if (!setup->deadman_ms || setup->deadman_ms > UINT16_MAX)
		problem = "a deadman of less than 1 ms or more than 65 s";
	else if (!setup->heartbeat_ms || setup->heartbeat_ms > UINT16_MAX)
		problem = "a heartbeat of less than 1 ms or more than 65 s";
	else if (!setup->master || setup->master > 127 ||
		 setup->master == client->master->node)
		problem =
			"a node id of this program that is 0, over 127 or the drive's own";
	else if (client->master->own != setup->master ||
		 client->master->heartbeat_ns <= 0 ||
		 client->master->heartbeat_ns >= setup->deadman_ms * MS_NS)
		problem = "a deadman shorter than this program's heartbeats";
	else if (setup->mode != CIA402_CSP && setup->mode != CIA402_CSV &&
		 setup->mode != CIA402_CST)
		problem = "a mode that is not cyclic";
	else if (!setup->cycle_ns)
		problem = "a cycle of 0";
	return problem ? cia402_error(client, EINVAL, "%s cannot be set up; see rig.conf",
				      problem)
		       : 0;
}

static int check_power(const struct cia402_client *client)
{
	enum cia402_state state;
	int rc = cia402_read_state(client, &state);

	if (rc || !cia402_powered(state))
		return rc;
	return cia402_error(client, EBUSY,
			    "the drive is on (%s): another master controls it, or it "
			    "was left on; disable it first",
			    cia402_state_name(state));
}

static int send_nmt(const struct cia402_client *client, enum canopen_command command)
{
	int rc = canopen_send_nmt(client->master, command);

	/* A full queue empties soon, unless the bus is stuck. */
	for (int i = 0; i < 10 && rc == -ENOBUFS; i++) {
		rc = cia402_pause(client, MS_NS);
		if (rc)
			return rc;
		rc = canopen_send_nmt(client->master, command);
	}
	return rc ? cia402_fail(client, &nmt, "changed", rc) : 0;
}

/* Write an object that the drive may refuse. */
static int write_hint(const struct cia402_client *client,
		      const struct cia402_object *object, uint32_t value)
{
	int rc = canopen_write(client->master, object->index, object->sub, object->size,
			       value);

	return rc && rc != -EREMOTEIO ? cia402_fail(client, object, "written", rc) : 0;
}

/*
 * Set mode, cycle and SYNC. 1006 and 1007 are hints for drives that lock their loops to SYNC.
 */
static int set_cycle(const struct cia402_client *client, const struct cia402_setup *setup)
{
	/* Drives with a fixed power of ten have ms. */
	static const int8_t powers[] = {-3, -4, -5, -6, -2, -1, 0};
	uint32_t available = 0;
	bool has;
	int rc = cia402_read_optional(client, &modes, &available, &has);

	if (rc)
		return rc;
	if (has && !(available & 1u << (setup->mode - 1)))
		return cia402_error(client, EOPNOTSUPP,
				    "the drive lacks the mode %s: its 6502:0 is %08Xh; "
				    "choose another mode in rig.conf, or check its "
				    "firmware",
				    cia402_mode_name(setup->mode), available);
	rc = cia402_set_mode(client, setup->mode);
	if (rc >= 0)
		rc = cia402_ensure(client, &sync_id, SYNC_ID);
	if (rc)
		return rc;
	rc = write_hint(client, &sync_period, setup->cycle_ns / 1000);
	if (!rc)
		rc = write_hint(client, &sync_window, 0);
	if (rc)
		return rc;
	for (size_t i = 0; i < sizeof(powers); i++) {
		uint64_t unit_ns = 1000000000;

		for (int k = 0; k > powers[i]; k--)
			unit_ns /= 10;
		if (setup->cycle_ns % unit_ns || setup->cycle_ns / unit_ns > UINT8_MAX)
			continue;
		rc = cia402_ensure(client, &cycle, (uint32_t)(setup->cycle_ns / unit_ns));
		return rc ? rc : cia402_ensure(client, &cycle_power, (uint32_t)powers[i]);
	}
	return cia402_error(client, EINVAL,
			    "a cycle of %u ns cannot be represented in the drive; "
			    "choose another cycle_us in rig.conf",
			    setup->cycle_ns);
}

/* Set the reaction to silence of this side, and the heartbeats that detect it. */
static int set_watch(const struct cia402_client *client, const struct cia402_setup *setup)
{
	uint32_t emcy = (uint32_t)CANOPEN_EMCY + client->master->node;
	uint32_t watched = (uint32_t)setup->master << 16 | setup->deadman_ms;
	bool has;
	int rc = cia402_write_verified(client, &abort_option, QUICK_STOP);

	if (!rc)
		rc = cia402_write_verified(client, &stop_option, RAMP_THEN_OFF);
	/* Pre-operational without a master: then late PDOs have no effect. */
	if (!rc)
		rc = cia402_write_optional(client, &behaviour, 0, &has);
	if (!rc)
		rc = cia402_ensure(client, &emcy_id, emcy);
	if (!rc)
		rc = cia402_write_verified(client, &producer, setup->heartbeat_ms);
	return rc ? rc : cia402_write_verified(client, &consumer, watched);
}

/* The drive's heartbeat reports the new state. */
static int start_cia402_setup(const struct cia402_client *client,
			      const struct cia402_setup *setup)
{
	struct canopen *master = client->master;
	struct can_bus *bus = master->bus;
	int rc;

	/* The drive watches heartbeats from the first one on. */
	master->next_heartbeat_ns = 0;
	master->state = CANOPEN_UNKNOWN;
	rc = send_nmt(client, CANOPEN_START);
	if (rc)
		return rc;
	rc = canopen_await(master, canopen_is_operational,
			   bus->ops->now(bus) + NMT_NS + 2 * MS_NS * setup->heartbeat_ms);
	if (rc == -ETIMEDOUT)
		return cia402_error(client, ETIMEDOUT,
				    "the drive does not become operational: its "
				    "heartbeat reports %s; see its EMCY codes with "
				    "`incise info` of this bus",
				    canopen_state_name(master->state));
	if (rc)
		return cia402_fail(client, &nmt, "heard", rc);
	return check_power(client);
}

int cia402_configure(const struct cia402_client *client, const struct cia402_setup *setup,
		     struct cia402_supported *supported)
{
	int rc = check_cia402_setup(client, setup);

	*supported = (struct cia402_supported){0};
	if (!rc)
		rc = check_power(client);
	if (!rc)
		rc = send_nmt(client, CANOPEN_PREPARE);
	if (!rc)
		rc = set_pdos(client, setup, supported);
	if (!rc)
		rc = set_limits(client, setup);
	if (!rc)
		rc = set_cycle(client, setup);
	if (!rc)
		rc = set_watch(client, setup);
	if (!rc)
		rc = start_cia402_setup(client, setup);
	return rc;
}
