"""Names of body parts in other languages, and the English word of `bone_names` for each."""

from __future__ import annotations

import unicodedata

# German, Spanish, French, Italian, Portuguese, Russian, Chinese, Korean; Japanese as MikuMikuDance has it. Without
# accents, sharp s as ss.
_WORDS = {
    "hips": "huefte huften becken cadera caderas bassin hanche hanches bacino anca anche quadril センター 腰 "
    "таз бедра 骨盆 臀部 臀 골반 엉덩이",
    "hip": "hufte 髋 髋关节 고관절",
    "spine": "wirbelsaule wirbelsaeule rucken ruecken columna espalda colonne dos colonna schiena coluna 上半身 "
    "позвоночник спина поясница 脊柱 脊椎 腰椎 척추 허리",
    "chest": "brust brustkorb pecho torax poitrine torace petto peito грудь 胸 胸部 가슴",
    "neck": "hals nacken cuello cou collo pescoco 首 шея 颈 颈部 頸 脖子 목",
    "head": "kopf cabeza tete testa cabeca 頭 голова 头 头部 머리",
    "thigh": "oberschenkel muslo cuisse coscia coxa 足 бедро 大腿 허벅지",
    "leg": "bein pierna jambe gamba perna нога 腿 다리",
    "shin": "unterschenkel espinilla mollet polpaccio canela голень 小腿 종아리 정강이",
    "knee": "knie rodilla genou ginocchio joelho ひざ колено 膝 膝盖 膝蓋 무릎",
    "ankle": "knochel knoechel sprunggelenk tobillo cheville caviglia tornozelo 足首 "
    "лодыжка щиколотка 脚踝 腳踝 踝 발목",
    "foot": "fuss pie pied piede стопа ступня 脚 腳 발",
    "toes": "zehen zeh dedospie orteils orteil つま先 носок 脚趾 腳趾 脚尖 발가락 발끝",
    "clavicle": "schlusselbein schluesselbein clavicula clavicola ключица 锁骨 鎖骨 쇄골",
    "shoulder": "schulter hombro epaule spalla ombro 肩 肩膀 肩部 어깨",
    "upperarm": "oberarm brazo bras braccio braco 腕 плечо 上臂 大臂 위팔 윗팔 상완",
    "forearm": "unterarm antebrazo avantbras avambraccio antebraco предплечье 前臂 小臂 아래팔 아랫팔 전완",
    "elbow": "ellbogen ellenbogen codo coude gomito cotovelo ひじ локоть 肘 手肘 팔꿈치",
    "hand": "mano main mao кисть 手 手掌 손",
    "wrist": "handgelenk muneca poignet polso pulso 手首 запястье 手腕 腕部 손목",
}
_SIDES = {
    "left": "links linker linke linkes izquierda izquierdo izq gauche sinistra sinistro sx esquerda esquerdo 左 "
    "левая левый левое лев л 왼쪽 왼 좌",
    "right": "rechts rechter rechte rechtes derecha derecho der droite droit destra destro dx direita direito 右 "
    "правая правый правое прав п 오른쪽 오른 우",
}


def without_accents(name: str) -> str:
    """A name without accents; letters of other alphabets stay."""
    if name.isascii():
        return name
    marked = unicodedata.normalize("NFKD", name.replace("ß", "ss"))
    return unicodedata.normalize("NFC", "".join(c for c in marked if not "\u0300" <= c <= "\u036f"))


ENGLISH = {without_accents(word): english for english, words in _WORDS.items() for word in words.split()}
LEFT, RIGHT = (frozenset(map(without_accents, _SIDES[side].split())) for side in ("left", "right"))
