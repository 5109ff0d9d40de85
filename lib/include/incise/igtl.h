/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Messages of OpenIGTLink, header versions 1 and 2, as bytes: packing, parsing, and messages
 * from a stream of bytes of any sender. No sockets: the caller has them. All numbers on the
 * wire are big-endian, positions in mm, times in UTC.
 *
 *     header, 58 bytes                                       body
 *     ┌────────┬──────┬──────┬─────────┬───────────┬─────┐┌───────────────────────────────┐
 *     │version │ type │ name │ seconds │ body size │ CRC ││ content              version 1│
 *     │ 2      │ 12   │ 20   │ and 2⁻³²│ 8         │ 8   │├──────────┬─────────┬──────────┤
 *     └────────┴──────┴──────┴─────────┴───────────┴─────┘│extended  │ content │ metadata │
 *                                       of the body ↑     │header, 12│         │ version 2│
 *                                                         └──────────┴─────────┴──────────┘
 *
 * Reference: OpenIGTLink protocol version 3 (openigtlink.org); the bytes are those of
 * libopenigtlink, except that fractions of a second are exact: that library is up to 12 ns off.
 *
 * Only the functions of a stream allocate memory; none makes a system call or waits. All may be
 * called from any thread.
 */
#ifndef INCISE_IGTL_H
#define INCISE_IGTL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

#define INCISE_IGTL_PORT 18944	      /**< the usual TCP port */
#define INCISE_IGTL_HEADER 58	      /**< bytes of a header */
#define INCISE_IGTL_EXTENDED 12	      /**< bytes of an extended header, version 2 */
#define INCISE_IGTL_TYPE 12	      /**< longest type, bytes */
#define INCISE_IGTL_NAME 20	      /**< longest name of a device, bytes */
#define INCISE_IGTL_STRING_MAX 0xffff /**< longest text of a STRING, bytes */

/** CRC-64 of the protocol: polynomial of ECMA-182, from 0. @param crc of the bytes before */
INCISE_API uint64_t incise_igtl_crc64(uint64_t crc, const void *bytes, size_t n);

/**
 * A time as on the wire: seconds in the upper 32 bits, fraction in the lower ones, rounded to
 * the nearest 2⁻³² s.
 *
 * @param utc_ns since 1970, leap seconds not counted
 * @return 0, which says "no time", for a time before 1970 or after February 2106
 */
INCISE_API uint64_t incise_igtl_time(int64_t utc_ns);

/** The inverse, ns, rounded. Exact for a time that incise_igtl_time() made. */
INCISE_API int64_t incise_igtl_time_ns(uint64_t time);

/** A key and a value, not terminated: metadata of a message of version 2. */
struct incise_igtl_pair {
	const char *key;   /**< UTF-8 */
	const char *value; /**< UTF-8, or as @encoding says */
	uint16_t key_n;	   /**< bytes */
	uint16_t
		encoding; /**< number of IANA: 3 US-ASCII, 106 UTF-8; set from the value when packed */
	uint32_t value_n; /**< bytes */
};

/** The parts of a message that are not its content. */
struct incise_igtl_label {
	int version;	  /**< of the header: 1 or 2 */
	const char *name; /**< of the device, at most INCISE_IGTL_NAME bytes */
	int64_t utc_ns;	  /**< time of acquisition, ns since 1970; 0: none */
	uint32_t id;	  /**< of the message; version 2 */
	const struct incise_igtl_pair
		*metadata; /**< version 2; version 1 leaves it out */
	int n_metadata;	   /**< at most 65535 */
};

/**
 * Pack a message of any type.
 *
 * @param bytes    result
 * @param capacity its size
 * @param type     "TRANSFORM", "GET_STATUS" …: at most INCISE_IGTL_TYPE bytes
 * @param content  body without the extended header and metadata, in the wire's order; NULL
 *                 with @n 0
 * @return size of the message; -ENOBUFS (@capacity is too small), -EINVAL (a version, a name or
 *         a type that there is not), -EMSGSIZE (metadata over 65535 pairs or bytes of a key).
 */
INCISE_API ssize_t incise_igtl_pack(void *bytes, size_t capacity,
				    const struct incise_igtl_label *label,
				    const char *type, const void *content, size_t n);

/**
 * Pack a TRANSFORM. Errors as of incise_igtl_pack().
 *
 * @param matrix rotation and translation, mm: x' = matrix[0][0] x + … + matrix[0][3]; rounded
 *               to float
 */
INCISE_API ssize_t incise_igtl_pack_transform(void *bytes, size_t capacity,
					      const struct incise_igtl_label *label,
					      const double matrix[3][4]);

/**
 * Pack a STRING. Errors as of incise_igtl_pack(); -EMSGSIZE over INCISE_IGTL_STRING_MAX bytes.
 *
 * @param text UTF-8, @n bytes; marked as US-ASCII if it is that, since old receivers ask for it
 */
INCISE_API ssize_t incise_igtl_pack_string(void *bytes, size_t capacity,
					   const struct incise_igtl_label *label,
					   const char *text, size_t n);

/** Codes of a STATUS. */
enum incise_igtl_code {
	INCISE_IGTL_INVALID = 0,
	INCISE_IGTL_OK = 1,
	INCISE_IGTL_UNKNOWN_ERROR = 2,
	INCISE_IGTL_BUSY = 6,
	INCISE_IGTL_UNKNOWN_INSTRUCTION = 12,
	INCISE_IGTL_NOT_READY = 13,
	INCISE_IGTL_DISABLED = 15,
	INCISE_IGTL_NOT_PRESENT = 16,
	INCISE_IGTL_HARDWARE_FAILURE = 18,
	INCISE_IGTL_SHUT_DOWN = 19,
};

/** A STATUS. */
struct incise_igtl_status {
	uint16_t code;	  /**< enum incise_igtl_code */
	int64_t sub_code; /**< of the sender */
	char error[21];	  /**< name of the error, 20 bytes; "" without */
	const char *text; /**< packed: terminated; parsed: @n bytes, not terminated */
	size_t n;	  /**< bytes of a parsed text without its end */
};

/** Pack a STATUS. Errors as of incise_igtl_pack(). */
INCISE_API ssize_t incise_igtl_pack_status(void *bytes, size_t capacity,
					   const struct incise_igtl_label *label,
					   const struct incise_igtl_status *status);

/** Scalars of an IMAGE. */
enum incise_igtl_scalar {
	INCISE_IGTL_INT8 = 2,
	INCISE_IGTL_UINT8 = 3,
	INCISE_IGTL_INT16 = 4,
	INCISE_IGTL_UINT16 = 5,
	INCISE_IGTL_INT32 = 6,
	INCISE_IGTL_UINT32 = 7,
	INCISE_IGTL_FLOAT32 = 10,
	INCISE_IGTL_FLOAT64 = 11,
};

/** An IMAGE, or a part of one. */
struct incise_igtl_image {
	uint8_t components; /**< per element: 1 luminance, 3 RGB */
	uint8_t scalar;	    /**< enum incise_igtl_scalar */
	bool little;	    /**< order of the bytes of a scalar */
	bool ras; /**< coordinates right, anterior, superior; else left, posterior, superior */
	uint16_t size[3];     /**< columns, rows, slices of the whole */
	double axis[3][3];    /**< step of a column, row, slice, mm */
	double centre[3];     /**< of the whole, mm */
	uint16_t offset[3];   /**< of this part */
	uint16_t part[3];     /**< its size; that of the whole without parts */
	const uint8_t *pixel; /**< columns fastest, components interleaved */
	size_t n;	      /**< bytes of @pixel */
};

/**
 * Pack an IMAGE. Errors as of incise_igtl_pack(); -EINVAL also if @n is not what the sizes
 * say, or a part is not inside the whole.
 */
INCISE_API ssize_t incise_igtl_pack_image(void *bytes, size_t capacity,
					  const struct incise_igtl_label *label,
					  const struct incise_igtl_image *image);

/** A message, parsed as far as all types are alike. It points into the bytes. */
struct incise_igtl_message {
	int version;		     /**< of the header: 1 or 2 */
	char type[13];		     /**< "TRANSFORM" …; printable */
	char name[21];		     /**< of the device; printable, others are '?' */
	int64_t utc_ns;		     /**< ns since 1970; 0: none */
	uint32_t id;		     /**< version 2; else 0 */
	const uint8_t *content;	     /**< body without extended header and metadata */
	size_t n;		     /**< its bytes */
	int n_metadata;		     /**< version 2; else 0 */
	const uint8_t *metadata;     /**< for incise_igtl_metadata() */
	const uint8_t *metadata_end; /**< the same */
};

/**
 * Parse a whole message, which may hold anything.
 *
 * @param message result; points into @bytes
 * @return size of the message; -EAGAIN (@n is less than that), -EPROTO (no message: a version or
 *         a type that there is not, sizes that contradict each other), -EBADMSG (wrong CRC).
 */
INCISE_API ssize_t incise_igtl_parse(const void *bytes, size_t n,
				     struct incise_igtl_message *message);

/** Read pair @i of the metadata, from 0. @return 0; -ENOENT; the pair points into the bytes */
INCISE_API int incise_igtl_metadata(const struct incise_igtl_message *message, int i,
				    struct incise_igtl_pair *pair);

/**
 * Read a TRANSFORM.
 *
 * @return 0; -EPROTO (another type or size), -EDOM (a value is not finite)
 */
INCISE_API int incise_igtl_transform(const struct incise_igtl_message *message,
				     double matrix[3][4]);

/**
 * Read a POSITION as the matrix of a TRANSFORM. Without an orientation the rotation is the unit
 * matrix; a quaternion is normalised.
 *
 * @return 0; -EPROTO (another type or size), -EDOM (a value is not finite, the quaternion is 0)
 */
INCISE_API int incise_igtl_position(const struct incise_igtl_message *message,
				    double matrix[3][4]);

/**
 * Read element @i of a TDATA, from 0.
 *
 * @param name result: of the instrument
 * @return 0; -EPROTO (another type or size), -ENOENT (there are fewer), -EDOM (a value is not
 *         finite)
 */
INCISE_API int incise_igtl_tdata(const struct incise_igtl_message *message, int i,
				 char name[21], double matrix[3][4]);

/**
 * Read a STRING.
 *
 * @param text     result: @n bytes, not terminated, in @encoding of IANA; or NULL
 * @return 0; -EPROTO (another type, or sizes that contradict each other)
 */
INCISE_API int incise_igtl_string(const struct incise_igtl_message *message,
				  const char **text, size_t *n, uint16_t *encoding);

/** Read a STATUS. @return 0; -EPROTO (another type or size) */
INCISE_API int incise_igtl_status(const struct incise_igtl_message *message,
				  struct incise_igtl_status *status);

/**
 * Read an IMAGE.
 *
 * @return 0; -EPROTO (another type, or sizes that contradict each other), -EDOM (a position is
 *         not finite)
 */
INCISE_API int incise_igtl_image(const struct incise_igtl_message *message,
				 struct incise_igtl_image *image);

struct incise_igtl_stream;

/**
 * Start to read messages from bytes as they come, which may be anything. Its memory grows with
 * what has arrived, not with what a header announces, up to @body_max and some kilobytes.
 *
 * @param body_max largest body to keep; larger ones are passed over
 * @return stream, to be freed with incise_igtl_stream_free(); NULL with errno ENOMEM
 */
INCISE_API struct incise_igtl_stream *incise_igtl_stream_new(size_t body_max);

/**
 * Go on with bytes up to the end of a message. Call it again until it returns 0 or -EPROTO.
 *
 * @param bytes   in: what arrived; out: what is left
 * @param n       the same, their number
 * @param message result with 1: points into memory of the stream, valid until the next call
 * @return 1 (a message), 0 (more bytes are needed), -EBADMSG (a message with a wrong CRC was
 *         passed over), -EMSGSIZE (the header announces a body over @body_max, which will be
 *         passed over; @message has its version, type, name and time), -ENOMEM (the same, without
 *         memory), -EPROTO (not OpenIGTLink: there is no next message in it, and each further call
 *         returns this).
 */
INCISE_API int incise_igtl_stream_next(struct incise_igtl_stream *stream,
				       const uint8_t **bytes, size_t *n,
				       struct incise_igtl_message *message);

/** Whether the bytes so far end inside a message: a sender that stops there is stalled. */
INCISE_API bool incise_igtl_stream_inside(const struct incise_igtl_stream *stream);

/** NULL is accepted. */
INCISE_API void incise_igtl_stream_free(struct incise_igtl_stream *stream);

INCISE_END_DECLS
#endif
