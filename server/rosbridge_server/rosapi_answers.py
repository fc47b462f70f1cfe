"""What the services of rosapi answer, as .msg text: for those who ask rosapi for it."""

from __future__ import annotations

from server.judge.message import RosVersion

_TYPEDEFS = f"""rosapi/TypeDef[] typedefs
{"=" * 80}
MSG: rosapi/TypeDef
string type
string[] fieldnames
string[] fieldtypes
int32[] fieldarraylen
string[] examples
string[] constnames
string[] constvalues
"""
_TEXTS = {
    "topics": "string[] topics\nstring[] types\n",
    "topics_for_type": "string[] topics\n",
    "topics_and_raw_types": "string[] topics\nstring[] types\nstring[] typedefs_full_text\n",
    "topic_type": "string type\n",
    "message_details": _TYPEDEFS,
    "publishers": "string[] publishers\n",
    "subscribers": "string[] subscribers\n",
    "nodes": "string[] nodes\n",
    "node_details": "string[] subscribing\nstring[] publishing\nstring[] services\n",
    "services": "string[] services\n",
    "services_for_type": "string[] services\n",
    "service_type": "string type\n",
    "service_node": "string node\n",
    "service_host": "string host\n",
    "service_providers": "string[] providers\n",
    "service_request_details": _TYPEDEFS,
    "service_response_details": _TYPEDEFS,
    "action_servers": "string[] action_servers\n",
    "get_param": "string value\n",
    "has_param": "bool exists\n",
    "get_param_names": "string[] names\n",
    "search_param": "string global_name\n",
    "get_ros_version": "uint8 version\nstring distro\n",
    "set_param": "",
    "delete_param": "",
}
_TIMES = {1: "time time\n", 2: "builtin_interfaces/Time time\n"}


def answer_text(service: str, version: RosVersion) -> str:
    """Of one service, named without /rosapi/. The types of ROS 2 are in the package rosapi_msgs."""
    if service == "get_time":
        return _TIMES[version]
    text = _TEXTS[service]
    return text if version == 1 else text.replace("rosapi/", "rosapi_msgs/")
